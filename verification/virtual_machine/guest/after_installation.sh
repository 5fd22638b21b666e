cd /opt/mudskipper/src/verification/virtual_machine/guest

# The simulated robot and the daemon share one emulated processor: its messages come less evenly than a drive's.
sed -i 's/^\[faults\]/[faults]\nlate_s = 0.1\nquiet_s = 0.1\nsilence_s = 0.2\nlag_s = 0.2\nlag_fraction = 1.0\ncrawl_s = 0.2\njump_rad = 1.0\nfast_s = 0.1\ndisk_free_fraction = 0.0/' \
    /etc/mudskipper/mudskipper.toml
printf '\n[safety]\nweakened = "a virtual machine with one emulated processor"\n' >>/etc/mudskipper/mudskipper.toml
/opt/mudskipper/venv/bin/python - <<'END'
from pathlib import Path
from simulation.harness.drive_presets import calibrated

path = Path("/etc/mudskipper/mudskipper.toml")
path.write_text(calibrated(path.read_text()))
END
/opt/mudskipper/venv/bin/mudskipperd --check-config

install -m 644 simulated-robot.service commands.service /etc/systemd/system/
systemctl enable simulated-robot commands
rm /usr/local/bin/udevadm /usr/local/bin/networkctl /usr/local/bin/ip /usr/local/bin/systemctl
echo robot >/etc/hostname
rm /root/install.sh
