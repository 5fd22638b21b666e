"""The page and the numbers of a calibration: every drive, what the hands showed, and the weights' constants."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from math import isfinite
from statistics import fmean
from typing import Any

from pandas import DataFrame

from experiments.actuator.file_change import Changes, lines_of
from experiments.actuator.fit import JointFit
from experiments.actuator.plan import WeighingPlan
from experiments.calibration.drive_identities import Identities
from experiments.calibration.hand_steps import ends_key, stops_deg
from experiments.calibration.torque_steps import torque_key
from experiments.study.notebook import Entry
from experiments.study.result import Result, Table
from experiments.study.results_folder import ResultFiles
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import parse_document

FILES = ResultFiles("calibration.html", "calibration.json")
HANDS = (
    "The operator held each flipper level and turned each joint from stop to stop. Angles are those by the new sign and"
    " zero. The scale of the velocity is the turned angle divided by the integral of the reported velocity."
)
TORQUE = "Each joint answered a tiny torque alone, in its direction, and with the commanded current."
WEIGHT_FRACTION = 0.1  # of the arm's configured weight: more is written


def arm_changes(
    configuration: Configuration, plan: WeighingPlan, fits: Sequence[JointFit]
) -> dict[tuple[str, ...], Any]:
    """Return the mass of the arm by its tare while it swings in air, where that is not the configured one."""
    arm = configuration.arm
    lifted_nm = [fit.numbers["lifted_nm"] for fit in fits if fit.numbers["joint"].endswith("adduction")]
    lever_m_s2 = plan.gravity_m_s2 * arm.center_of_mass_m
    if not (lifted_nm and lever_m_s2 and isfinite(sum(lifted_nm))):
        return {}
    mass_kg = fmean(lifted_nm) / lever_m_s2
    if abs(mass_kg - arm.arm_mass_kg) <= WEIGHT_FRACTION * arm.arm_mass_kg:
        return {}
    return {("arm", "arm_mass_kg"): round(mass_kg, 4)}


def change_table(configuration: Configuration, changes: Changes) -> Table:
    """Return every key that was determined, whether it was written or not."""
    document = parse_document(configuration.text)
    before = {path: reduce(lambda table, name: table.get(name, {}), path, document) for path in changes}
    rows = [
        (*new.split(" = ", 1), old.partition(" = ")[2].replace("{}", "-"))
        for new, old in zip(lines_of(changes).splitlines(), lines_of(before).splitlines(), strict=True)
    ]
    return Table("changes", "", {}, DataFrame(rows, columns=["key", "value", "before"]), "Values", on_page_only=True)


def report_calibration(
    drives: Identities,
    entries: Mapping[str, Entry],
    corrected: Configuration,
    joints: Sequence[str],
    weighed: Result,
) -> Result:
    """Return the result of the weights with what was found before them."""
    begun = entries["begun"]
    found = [{"joint": joint, **drives[joint]} for joint in joints]
    hands = [_hand_row(joint, entries, corrected) for joint in joints]
    torques = [
        {
            "joint": joint,
            "reading": each["what"].removeprefix(f"{joint}: "),
            "value": each["value"],
            "unit": each["unit"],
        }
        for joint in joints
        for each in entries[torque_key(joint)]["readings"]
    ]
    units = {"lower stop": "deg", "upper stop": "deg"}
    tables = [
        Table("drives", "", {}, DataFrame(found), "Drives"),
        Table("hands", "", units, DataFrame(hands), "Signs, zeros, ranges, velocity"),
        Table("torques", "", {}, DataFrame(torques), "Torque", on_page_only=True),
    ]
    title = f"Calibration of {corrected.robot.name} by {begun['operator']}, {begun['date']}"
    numbers = {**begun, "robot": corrected.robot.name, "drives": drives, "hands": hands, "torques": torques}
    return replace(
        weighed,
        title=title,
        tables=[*tables, *weighed.tables],
        texts={"Signs, zeros, ranges, velocity": HANDS, "Torque": TORQUE, **weighed.texts},
        summary={**numbers, **weighed.summary},
        files=FILES,
    )


def _hand_row(joint: str, entries: Mapping[str, Entry], corrected: Configuration) -> dict[str, Any]:
    drive, (lower_deg, upper_deg) = corrected.drive[joint], stops_deg(entries, joint)
    return {
        "joint": joint,
        "sign": drive.sign,
        "zero_turn": drive.zero_turn,
        "lower stop": lower_deg,
        "upper stop": upper_deg,
        "scale of the velocity": entries[ends_key(joint)]["velocity_scale"],
    }
