"""Arms the robot, walks three strides and prints the measured mud. Start a simulated robot first:

mudskipper simulate                    # prints the two commands for the daemon and the socket
python examples/operate_robot.py
"""

import mudskipper

with mudskipper.Client(lease_s=2.0) as robot:
    for item in robot.check():
        if not item["ok"]:
            print(f"{item['id']}: {item['text']}; {item['fix']}")
    robot.arm()
    robot.wait_for("hold")
    before = robot.status()["strides_closed"]
    robot.walk(strides=3)
    robot.wait_for("walking")
    robot.wait_for("hold", timeout_s=60.0)
    for stride in robot.strides(since=before):
        k_p = stride["k_p"]
        print(f"{stride['flipper']:5} {stride['index']}: k_p = {1e-6 * k_p['value']:.2f} N/cm³")
    robot.disarm()
    robot.wait_for("idle")
