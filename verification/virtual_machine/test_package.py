"""The Debian package is installed, checked, upgraded, taken back, removed and purged, in a machine of its own."""

from collections.abc import Iterator

import pytest

from verification.virtual_machine.installed_robot import installed_robot
from verification.virtual_machine.machine import Machine
from verification.virtual_machine.robot import CONFIGURATION, Robot

FIRST, SECOND = "/root/mudskipper_1.0_amd64.deb", "/root/mudskipper_1.1_amd64.deb"
BUILD = f"""\
cd /opt/mudskipper/src
VERSION=1.0 COMPRESSION=gzip sh debian/build /root
dpkg-deb --raw-extract {FIRST} /root/package
cd /root/package
sed -i s/^Version:.*/Version:1.1/ DEBIAN/control
echo '# new' >>opt/mudskipper/venv/share/mudskipper/mudskipper-live.service
sed -i 's/^    key: Annotated.*/    spare: Annotated[str, Meaning("of the check")] = ""\\n&/' \\
    opt/mudskipper/venv/lib/python3*/site-packages/drivers/power_switch.py
dpkg-deb -Zgzip --build /root/package {SECOND}
rm -r /root/package
echo force-unsafe-io >/etc/dpkg/dpkg.cfg.d/emulated  # a wait for the disk after each file takes minutes
"""
REPLACE = """\
systemctl stop mudskipper simulated-robot
mudskipper uninstall
rm -rf /opt/mudskipper/venv
dpkg --install {}
sed -i 's/\\bcan\\([01]\\)/vcan\\1/g' /etc/systemd/system/mudskipper.service
systemctl daemon-reload
"""
VERSION = "dpkg-query --show --showformat='${Version}' mudskipper"


@pytest.fixture(scope="module")
def packaged() -> Iterator[Robot]:
    """Yield a robot whose software is the first package."""
    machine = Machine(installed_robot("packages", BUILD))
    try:
        machine.boot()
        robot = Robot(machine)
        robot.shell(f"set -e; {REPLACE.format(FIRST)}", 120.0)
        robot.rest()
        yield robot
    finally:
        machine.close()


def test_the_service_of_the_package_runs(packaged: Robot) -> None:
    assert packaged.shell("systemctl is-enabled mudskipper") == "enabled\n"
    assert packaged.shell("dpkg --verify mudskipper") == ""
    assert packaged.shell(VERSION) == "1.0"


@pytest.mark.parametrize(
    "command", [f"dpkg --install {SECOND}", f"mudskipper upgrade {SECOND}", "dpkg --remove mudskipper"]
)
def test_a_robot_that_walks_is_not_upgraded(packaged: Robot, command: str) -> None:
    if not packaged.walks_without_faults():
        packaged.walk()
    answer = packaged.machine.run(command, longest_s=120.0)
    assert answer.status != 0 and "walking" in answer.errors + answer.output
    assert packaged.shell(VERSION) == "1.0" and packaged.walks_without_faults()


def test_a_check_names_what_changes(packaged: Robot) -> None:
    packaged.rest()
    shown = packaged.shell(f"mudskipper upgrade --check {SECOND}")
    assert "1.0 -> 1.1" in shown and "emergency_stop.spare is new" in shown and "mudskipper-live.service" in shown
    assert packaged.shell(VERSION) == "1.0"


def test_an_upgrade_and_the_way_back_keep_the_configuration(packaged: Robot) -> None:
    packaged.rest()
    digest = packaged.shell(f"sha256sum {CONFIGURATION}")
    for package, version, added in ((SECOND, "1.1", 1), (FIRST, "1.0", 0)):
        packaged.shell(f"mudskipper upgrade {package}", 120.0)
        packaged.wait_until_ready()
        assert packaged.shell(VERSION) == version and packaged.unit("ActiveState") == "active"
        assert packaged.shell(f"sha256sum {CONFIGURATION}") == digest
        unit = packaged.shell("cat /etc/systemd/system/mudskipper-live.service")
        assert unit.count("# new") == added


def test_a_removal_keeps_configuration_and_logs_and_a_purge_does_not(packaged: Robot) -> None:
    packaged.shell("systemctl stop simulated-robot; dpkg --remove mudskipper", 120.0)
    packaged.shell(f"test -e {CONFIGURATION} -a -d /var/lib/mudskipper -a ! -e /opt/mudskipper/venv")
    packaged.shell("! systemctl is-enabled mudskipper && ! systemctl cat mudskipper-live")  # the first one is edited
    packaged.shell("! test -e /usr/local/bin/mudskipper")
    packaged.shell("dpkg --purge mudskipper")
    packaged.shell("! test -e /etc/mudskipper && ! test -e /var/lib/mudskipper && ! getent passwd mudskipper")
