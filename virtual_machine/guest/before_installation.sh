# The system is a folder and does not run: units are enabled and not started, and who is asked to look again need not,
# since the first boot looks at everything.
for asker in udevadm networkctl ip; do
    ln -s /bin/true "/usr/local/bin/$asker"
done
cat >/usr/local/bin/systemctl <<'END'
#!/bin/sh
verb=$1
shift
case $verb in
enable | reenable | disable) [ "$1" != --now ] || shift; SYSTEMD_OFFLINE=1 exec /usr/bin/systemctl "$verb" "$@" ;;
esac
END
chmod +x /usr/local/bin/systemctl
adduser --quiet --disabled-password --gecos "" alice
adduser --quiet --disabled-password --gecos "" mallory
