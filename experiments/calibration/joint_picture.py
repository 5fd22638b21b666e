"""Draws the robot as text, with the flipper or the joint that an operator is asked to move."""

VIEWS = {"sweep": "from above, front at the top", "adduction": "from behind", "": "from behind"}
BODY = ("+------+", "|      |", "+------+")


def draw_joint(name: str) -> str:
    """Draw a joint such as left_sweep with arrows, or a whole flipper such as left without."""
    side, _, kind = name.partition("_")
    marks = {each: ("^", "v", "#") if each == side else (" ", " ", "=") for each in ("left", "right")}
    (up, down, plate), (up_right, down_right, plate_right) = marks.values()
    if not kind:
        up = down = up_right = down_right = " "
    lines = (
        f"      {up}       {BODY[0]}       {up_right}",
        f"   [{plate * 5}]-----o{BODY[1]}o-----[{plate_right * 5}]",
        f"      {down}       {BODY[2]}       {down_right}",
        f"    left                    right    ({VIEWS[kind]})",
    )
    return "\n".join(line.rstrip() for line in lines)
