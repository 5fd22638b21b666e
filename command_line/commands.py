"""The commands of `mudskipper`: function and help of each, and the module that adds its options.

A function is named as `module.function` below this package, and imported when the command is used.
"""

COMMANDS = {  # module of options/ -> command -> function, help
    "operation": {
        "status": ("operation.operation.status", "Print the state of the robot."),
        "arm": ("operation.operation.arm", "Switch torque on. The robot holds its present pose."),
        "walk": ("operation.operation.walk", "Walk, with a fixed depth or one that adapts to the mud."),
        "move": ("operation.operation.move", "Move joints slowly to other angles while the robot holds its pose."),
        "stop": ("operation.confirmed_stop.end_motion", "End the walk, raise the flippers and hold the pose."),
        "disarm": ("operation.confirmed_stop.end_motion", "Switch torque off at once, in any state."),
        "clear": ("operation.operation.clear", "Clear a fault and the errors of the drives."),
        "check": (
            "operation.operation.check",
            "List what prevents the robot from being armed, and what to do about it.",
        ),
        "watch": ("watch.watch.watch", "Show the robot live, with keys that operate it."),
        "fail": ("operation.failing.fail", "Make a part of the robot fail on purpose, where allowed."),
    },
    "computer": {
        "live": ("live.live.live", "Pass the robot's rows on to Foxglove, Lichtblick or a browser."),
        "doctor": ("doctor.doctor.doctor", "Check this computer and its buses, line by line."),
        "init": ("init.init.init", "Write a configuration for a new robot, from questions or options."),
        "install": ("install.installation.install", "Set up the service, network and users of this computer."),
        "uninstall": (
            "install.installation.uninstall",
            "Undo the installation; configuration and logs stay.",
        ),
    },
    "drives": {"drives": ("", "Find and set up motor drives, while the daemon does not run.")},
    "simulation": {
        "demo": ("demo.demo.demo", "Walk a simulated robot over three muds, in real time."),
        "simulate": ("simulate.simulate", "Simulate the robot on a bus until Ctrl-C."),
    },
    "logs": {
        "replay": ("logs.log_commands.replay", "Run the estimator over a recorded log."),
        "plot": ("logs.log_commands.plot", "Draw a walk against time: forces, coefficients, depth."),
        "film": ("logs.log_commands.film", "Draw strides from the side, as a strip or a film."),
        "log": ("", "Read and manage logs."),
    },
    "experiments": {"experiment": ("", "The paper's experiments.")},
}
