"""The commands of `mudskipper`: the function and the help of each.

A function is named as `module.function` below this package, and imported when its command is used. So is a study.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

Command: TypeAlias = tuple[Any, str]  # a name, the commands of a group, or a study, with the help


class Found(NamedTuple):
    """A group whose commands are found when it is used."""

    function: str  # that returns them


DRIVES: Mapping[str, Command] = {
    "find": ("drives.find.find", "List the drives that answer on the buses."),
    "setup": (
        "drives.setup.setup",
        "Compare the drives' settings with the configuration, and write those that differ.",
    ),
    "zero": ("drives.zero.zero", "Make a joint's present position its angle zero, in the configuration file."),
}
LOGS: Mapping[str, Command] = {
    "info": ("logs.log_commands.info", "Print what a log contains."),
    "report": ("logs.log_report.log_report", "Write a run, or a comparison of runs, as a page."),
    "export": ("logs.log_export.export", "Write a log in a form that other programs read."),
    "preserve": ("logs.log_folder_commands.preserve_log", "Exclude logs from the quota."),
    "index": ("logs.catalogue_commands.index", "Read all new logs of a folder into its catalogue."),
    "query": ("logs.catalogue_commands.query", "Answer a SELECT on the catalogue of the logs."),
    "open": ("viewers.open_log.open_log", "Open a log in a viewer, with the project's layout."),
    "annotate": ("logs.log_folder_commands.annotate_log", "Change the description of a log that is closed."),
    "list": ("logs.log_folder_commands.list_logs", "List the logs and the room that is left."),
    "pull": ("logs.log_pull.pull", "Copy new logs from a robot over SSH, and mark them as copied."),
    "recover": ("logs.log_folder_commands.recover", "Repair logs whose writer was interrupted."),
}
GAIT: Mapping[str, Command] = {
    "check": ("gait.check", "Check a gait file, and draw its path over the ground."),
    "simulate": ("gait.simulate", "Walk a gait file in simulated mud."),
}
COMMANDS: Mapping[str, Command] = {
    "status": ("operation.status.status", "Print the state of the robot."),
    "arm": ("operation.operation.arm", "Switch torque on. The robot holds its present pose."),
    "walk": ("operation.operation.walk", "Walk, with a fixed depth or one that adapts to the mud."),
    "gait": (GAIT, "Check and simulate gaits of your own."),
    "run": (
        "operation.run.run",
        "Move by a control law of your own: a function in a file, once a stride or at a rate.",
    ),
    "move": ("operation.operation.move", "Move joints slowly to other angles while the robot holds its pose."),
    "probe": ("operation.probe.probe", "Find the height of the mud, with its error, by light touches."),
    "stop": ("operation.confirmation.stop", "End the walk, raise the flippers and hold the pose."),
    "joy": ("operation.joy.joy", "Drive the robot by a gamepad or keys: it stops when a button is released."),
    "disarm": ("operation.confirmation.disarm", "Switch torque off at once, in any state."),
    "clear": ("operation.operation.clear", "Clear a fault and the errors of the drives."),
    "check": ("operation.operation.check", "List what prevents the robot from being armed, and what to do about it."),
    "trial": ("operation.trial.trial", "Show or set how walks are described in their logs."),
    "note": ("operation.trial.note", "Write a note or a marker into the log."),
    "watch": ("watch.watch.watch", "Show the robot live, with keys that operate it."),
    "fail": ("operation.failing.fail", "Make a part of the robot fail on purpose, where allowed."),
    "live": ("live.live.live", "Pass the robot's rows on to Foxglove, Lichtblick or a browser."),
    "ros2": ("ros2.ros2.ros2", "Show the robot to computers with ROS 2 (rmw_zenoh), and serve its stop to them."),
    "doctor": ("doctor.doctor.doctor", "Check this computer and its buses, line by line."),
    "init": ("init.init.init", "Write a configuration for a new robot, from questions or options."),
    "install": ("install.installation.install", "Set up the service, network and users of this computer."),
    "uninstall": ("install.installation.uninstall", "Undo the installation; configuration and logs stay."),
    "upgrade": ("install.upgrade.upgrade", "Say what another version's package changes, and install it."),
    "drives": (DRIVES, "Find and set up motor drives, while the daemon does not run."),
    "calibrate": (
        "experiments.studies.CALIBRATE",
        "Calibrate signs, zeros, ranges, velocity, torque and friction, while the daemon does not run.",
    ),
    "demo": ("demo.demo.demo", "Walk a simulated robot over three muds, in real time."),
    "simulate": ("simulate.simulate", "Simulate the robot on a bus until Ctrl-C."),
    "replay": ("logs.log_commands.replay", "Run the estimator over a recorded log."),
    "plot": ("logs.log_commands.plot", "Draw a walk against time: forces, coefficients, depth."),
    "film": ("logs.log_commands.film", "Draw strides from the side, as a strip or a film."),
    "log": (LOGS, "Read and manage logs."),
    "experiment": (Found("experiments.studies.find_commands"), "The paper's experiments."),
}
