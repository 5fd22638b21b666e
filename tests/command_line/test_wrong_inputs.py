"""Wrong inputs of every command: no traceback, one exit status for one kind of mistake, a text that names the thing."""

from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.operation.confirmation import TORQUE_UNKNOWN
from simulation.harness.local_setup import configuration_text
from tests.command_line.command_lines import run

WRONG_COMMAND_LINES = [  # and what the message names
    ("", ""),
    ("wlak", "did you mean walk?"),
    ("--socket X status", "'mudskipper COMMAND --socket ...'"),
    ("log --json list", "'mudskipper log ACTION --json ...'"),
    ("log", "'mudskipper log --help'"),
    ("stop --jsn", "--jsn"),
    ("arm --f", "--f"),  # would overrule failed checks
    ("walk --depht 3", "did you mean --depth?"),
    ("walk --depth 3 --adaptive", "--adaptive"),
    ("walk" + 9 * " --depth 3", "at most 8 depths take turns"),
    ("walk --strides 0", "--strides"),  # would walk without end
    ("walk --depth 2.0mm", "2.0mm: must be a number in cm"),
    ("walk --depth 0.02", "from 0.5 to 20 cm"),  # m
    ("joy --keyboard --device /dev/input/event7", "--device: not allowed with argument --keyboard"),
    ("upgrade --check", "FILE"),
    ("simulate --world world.toml --mud 48.5", "--mud"),
    ("simulate --mud 48", "48.5"),
    ("simulate --local", "--config FILE"),
    ("simulate --reset --emergency-stop", "--emergency-stop: not allowed with argument --reset"),
    ("simulate --reset --mud 48.5", "--mud: not allowed with argument --reset"),
    ("simulate --bus a/b", "a/b"),
    ("move left_sweep=5 left_sweep=10", "left_sweep"),
    ("trial set mud=A water=40 mud=B", "mud is given twice"),
    ("log annotate x.mcap mud=A mud=B", "mud is given twice"),
    ("init - --node left_sweep=1 --node left_sweep=2", "left_sweep is given twice"),
    ("experiment lablogs . --group 12*=soft --group 12*=firm", "12* is given twice"),
    ("mudskipperd --check-config --config robot.toml --config keys.toml", "--config: is given twice"),
    ("walk --strides 2 --strides 3", "--strides: is given twice"),
    ("move left_sweep", "left_sweep: must be a joint and its angle"),
    ("move left_sweep=far", "left_sweep=far"),
    ("move =3", "=3"),
    ("move left_swep=10", "did you mean left_sweep?"),
    ("fail left_sweep", "KIND"),
    ("fail --list all", "--list"),
    ("fail all ok --for long", "long: must be a number in s"),
    ("live --port 70000", "70000"),
    ("ros2 --namespace 1x", "1x"),
    ("ros2 --distribution foxy", "foxy"),
    ("live --host 300.1.1.1", "--host 300.1.1.1"),
    ("live --page --host 192.0.2.1", "--host 192.0.2.1"),
    ("live --name robot.local", "--name belongs to --page"),
    ("log list", "name the folder of the logs: there is no /none/robot.toml"),
    ("log report x.mcap --mud =40", "--mud"),
    ("log report x.mcap --mud a --world b.toml", "--mud"),
    ("log report x.mcap --out text.mcap", "must be a folder"),
    ("log export x.mcap", "--parquet"),
    ("replay x.mcap --method papre", "did you mean paper?"),
    ("replay x.mcap --vertical z", "not a CSV log"),
    ("plot x.mcap --out x.gif", ".png"),
    ("film x.mcap --out x.mp4", ".png"),
    ("init - --set=length=1", "length"),
    ("init - --set=drop_m=deep", "deep"),
    ("init - --set=drop_m=nan", "nan"),
    ("init - --node=tail=1", "tail"),
    ("init - --defaults --flippers left --node=right_sweep=2", "no such joint"),
    ("init - --drive odriv", "did you mean odrive?"),
    ("init - --defaults --channel a --channel b --channel c", "3 channels"),
    ("init robot.toml --defaults", "robot.toml exists"),
    ("init - --defaults --fd", "--from-bus"),
    ("drives find --interface sockercan --channel can0", "did you mean socketcan?"),
    ("drives find --interface socketcan", "--channel"),
    ("drives find --config robot.toml --bus lefd", "did you mean left?"),
    ("drives setup left_swep --config robot.toml", "did you mean left_sweep?"),
    ("drives setup --config robot.toml --restore old.toml --backup old.toml", "--backup"),
    ("demo --depth -1", "-1"),
    ("experiment wlak", "did you mean walk?"),
    ("experiment loadcell --plate 3x", "3x"),
    ("experiment walk --mud =30", "=30"),
    ("experiment walk --mud 47.6=long", "47.6=long"),
    ("experiment walk --mud 47.6=3", "47.6=3"),
    ("experiment walk --out text.mcap", "folder"),
    ("experiment flipper", "--mud 47.6"),
    ("experiment walk", "--mud 47.6=61"),
    ("experiment flipper --simulated --mud clay", "clay"),
    ("experiment walk --mud 47.6 --mud 47.6=30", "--mud"),
    ("experiment trackway --method paper", "--method can only be given with --simulated"),
    ("experiment trackway --mud soft --mud soft", "--mud"),
    ("experiment trackway --simulated --mud 48.5", "--mud can only be given without --simulated"),
    ("experiment trackway --mud 48.5=5", "from 20 to 10000 cm"),
    ("experiment trackway --simulated --method paper --method fog", "'fog'"),
    ("experiment trackway --simulated --compartment 0.1", "--compartment"),
    ("experiment trackway --simulated --compartment nan", "--compartment"),
    ("experiment sweep", "--simulated"),
    ("experiment sweep --simulated --workers 2 --cluster tcp://127.0.0.1:8786", "--workers"),
    ("experiment sweep --simulated --strength 49", "--strength"),
    ("experiment sweep --simulated --strength firm", "--strength"),
    ("experiment actuator --simulated --weights heavy", "--weights"),
    ("experiment actuator --simulated --weights 100", "--weights"),
    ("experiment actuator --simulated --joint knee", "--joint"),
    ("calibrate --joint middle_sweep", "--joint"),
    ("calibrate --weights 100", "--weights"),
    ("experiment loadcell", "--port"),
    ("experiment loadcell --simulated --mud clay", "water content"),
    ("experiment loadcell --simulated --mud 70", "44 to 56"),
    ("experiment loadcell --simulated --mud 50 --mud 50", "same name"),
    ("experiment loadcell --simulated --mud a@b --mud A_b", "signs and capitals"),
    ("experiment loadcell --simulated --depth 4", "plate's height"),
    ("experiment loadcell --simulated --format words", "column1 to column9"),
    ("experiment loadcell --simulated --unit stone", "must be one of"),
    ("experiment loadcell --port /dev/nothing --position", "--position PATH"),
    ("experiment loadcell --port /dev/nothing --position /dev/other", "--position-step"),
    ("experiment loadcell --port /dev/nothing --position /dev/nothing", "two ports"),
    ("experiment loadcell --port /dev/nothing --position /dev/../dev/nothing", "two ports"),
    ("experiment loadcell --plate 3x900", "--plate"),
    ("init - --plate x --set plate_width_m=0.02", "--set plate_width_m: must be"),
    ("fail left_sweep off --list", "fail"),
    ("fail left_sweep off --for nan", "fail"),
    ("fail left_sweep off --for inf", "fail"),
]
MISSING_INPUTS = [
    "log info /none/x.mcap",
    "log report /none/x.mcap",
    "log report text.mcap --world /none/x.toml",
    "log export --csv /none/x.mcap",
    "log preserve x.mcap --undo",
    "log index /none/logs",
    "log list /none/logs",
    "log query select /none/logs",
    "log pull /none/logs",
    "replay /none/x.mcap",
    "replay text.mcap --config /none/x.toml",
    "plot /none/x.mcap",
    "simulate --config /none/x.toml",
    "simulate --world /none/x.toml",
    "demo --world /none/x.toml",
    "init - --plate /none/x.csv",
    "drives find --config /none/x.toml",
    "drives setup --config robot.toml --restore /none/x.json",
    "drives setup --config robot.toml --endpoints /none/x.json",
    "experiment actuator --simulated --config /none/x.toml",
    "experiment lablogs /none/x.csv",
    "experiment flipper --simulated --mud 47.6 --out out --truth /none/x.json",
    "experiment campaign /none/x.toml",
    "calibrate --out out --config /none/x.toml",
    "doctor --config /none/x.toml",
    "check --config /none/x.toml",
    "upgrade --check /none/x.deb",
    "joy --device /none/event7",
    "run /none/law.py",
    "gait check /none/gait.toml",
]
UNREADABLE = [  # and what the message names
    ("log info text.mcap", "text.mcap"),
    ("log report text.mcap", "text.mcap"),
    ("plot .", "."),
    ("gait check wlking", "did you mean walking?"),
    ("log open text.mcap --with rerun", "text.mcap"),
    ("log recover text.mcap", "text.mcap"),
    ("log query nonsense .", "nonsense"),
    ("upgrade text.mcap", "text.mcap"),
    ("joy --keyboard", "terminal"),
    ("joy --device text.mcap", "text.mcap"),
    ("log pull -- -oProxyCommand=x:", "-oProxyCommand=x:"),
    ("drives find --interface slcan --channel /none", "slcan /none"),
]
READ_CONFIGURATION = ("simulate", "drives find", "replay text.mcap", "mudskipperd --check-config")
WRONG_CONFIGURATIONS = [
    (f"{command} --config {file}", named)
    for command in READ_CONFIGURATION
    for file, named in (
        ("keys.toml", "drive.left_sweep.nod_id: there is no such key; did you mean node_id?"),
        ("keys.toml", "robbot: there is no such key; did you mean robot?"),
        ("interface.toml", "'sockercan': python-can has no such interface; did you mean socketcan?"),
        ("type.toml", "drive.left_sweep.type = 'odriv': there is no such type; did you mean odrive?"),
    )
]
WRONG_CONFIGURATIONS += [
    (f"{command} broken.toml", "broken.toml: not a TOML file: ")
    for command in (
        *(f"{command} --config" for command in READ_CONFIGURATION),
        *("log list --config", "log recover --config", "simulate --world", "demo --world"),
        "experiment actuator --simulated --out out --config",
    )
]
WRONG_CONFIGURATIONS += [
    *((f"{command} --world world.toml", "world.toml: segment 1.strength_pa = -1") for command in ("simulate", "demo")),
    ("init - --set drop_m=0.07", "geometry.axis_height_m"),
    ("init - --set drop_m=0.6", "geometry.drop_m = 0.6: must be at most 0.5"),
    ("init - --node left_sweep=1 --node right_sweep=1", "has the same on bus"),
]
NEEDS_DAEMON = (
    "status",
    "arm",
    "probe",
    "walk --depth 2.0cm",
    "move left_sweep=10",
    "stop",
    "disarm",
    "clear",
    "fail --list",
    "watch",
    "experiment trackway",
    "experiment flipper --mud 47.6",
    "experiment walk --mud 47.6",
)
CASES = [
    *((exit_codes.USAGE, *case) for case in WRONG_COMMAND_LINES),
    *(
        (exit_codes.UNHEALTHY, line, next(word for word in line.split() if word.startswith(("/none", "x."))))
        for line in MISSING_INPUTS
    ),
    *((exit_codes.UNHEALTHY, *case) for case in UNREADABLE),
    *(
        (exit_codes.UNHEALTHY, f"{command} --config broken.toml", "line 2, column 11")
        for command in ("check", "doctor")
    ),
    *((exit_codes.CONFIGURATION, *case) for case in WRONG_CONFIGURATIONS),
    *((exit_codes.NO_DAEMON, line, "no daemon answers on /none.sock") for line in NEEDS_DAEMON),
    (exit_codes.REFUSED, "log preserve text.mcap", "only a log in done/"),
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with files that are wrong, and one configuration that is not."""
    folder = tmp_path_factory.mktemp("inputs")
    text = configuration_text(folder, folder)
    wrong = {
        "keys.toml": text.replace("node_id = 0", "nod_id = 0") + '[robbot]\nname = "x"\n',
        "interface.toml": text.replace('"mudskipper_local"', '"sockercan"'),
        "broken.toml": "[limits]\ntorque_nm 0.8\n",
        "type.toml": text.replace("node_id = 0", 'node_id = 0\ntype = "odriv"'),
        "world.toml": "[[segment]]\nstart_m = 0\nend_m = 1\nstrength_pa = -1\n",
    }
    for name, content in {"robot.toml": text, "text.mcap": "no log\n", **wrong}.items():
        (folder / name).write_text(content, encoding="utf-8")
    return folder


@pytest.mark.parametrize(("status", "line", "named"), CASES, ids=[line or "nothing" for _, line, _ in CASES])
def test_a_wrong_input_is_refused_with_its_status_and_its_name(
    status: int, line: str, named: str, inputs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(inputs)
    monkeypatch.setattr("command_line.demo.demo.ENDING_SIGNALS", ())
    monkeypatch.setattr("command_line.robot_options.service_configuration", lambda: Path("/none/robot.toml"))
    before = set(inputs.iterdir())
    ended = run(*line.split(), MUDSKIPPER_SOCKET="/none.sock", XDG_RUNTIME_DIR=str(inputs))
    said = ended.stdout + ended.stderr
    assert ended.returncode == status, said
    assert named in " ".join(said.split()) and "Traceback" not in said
    assert (TORQUE_UNKNOWN in said) == (line in ("stop", "disarm"))
    if status in (exit_codes.USAGE, exit_codes.CONFIGURATION):  # before anything is made
        assert (ended.stdout == "" or "--json" in line) and set(inputs.iterdir()) == before
