"""The colours of all pictures of a walk, the same for the same thing in each.

What is drawn together differs for colour-blind readers too; a test simulates them.
"""

from experiments.pictures.stride_choice import Outcome

INK = "#33302c"
FAINT = "#8c867d"  # helper lines and small text
MUD_SHADES = ("#f4eee2", "#e6dac4", "#d6c6a8")  # one after the other along the track
MUD, SURFACE = "#cdb48f", "#8a6d45"  # seen from the side
BODY = "#ece8e1"
FLIPPER_COLOURS = {"left": "#5aa5c4", "right": "#1f6f8b"}
TRAIL = "#b5462f"
FORWARD, UP, FORCE = "#d55e00", "#0072b2", "#8e24aa"
OUTCOME_COLOURS = {
    Outcome.GOOD: "#0072b2",
    Outcome.SLIPPING: "#e69f00",
    Outcome.STUCK: "#6b0f1a",
    Outcome.UNKNOWN: FAINT,
}
