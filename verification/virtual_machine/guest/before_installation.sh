# The system is a folder and does not run: units are enabled and not started, and commands that make a running system
# reload do nothing, since the first boot loads everything.
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
