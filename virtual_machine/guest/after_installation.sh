cd /opt/mudskipper/src/virtual_machine/guest

# An emulated processor is less punctual than a robot's: signals may be older before they count as lost.
sed -i 's/^\[loop\]/[loop]\nsilence_s = 0.5/' /etc/mudskipper/mudskipper.toml

install -m 644 simulated-robot.service commands.service /etc/systemd/system/
systemctl enable simulated-robot commands
rm /usr/local/bin/udevadm /usr/local/bin/networkctl /usr/local/bin/ip /usr/local/bin/systemctl
echo robot >/etc/hostname
rm /root/install.sh
