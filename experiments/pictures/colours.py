"""The colours of all pictures of a walk, the same for the same thing in each."""

from experiments.pictures.stride_choice import Outcome

INK = "#33302c"
FAINT = "#8c867d"  # helper lines and small text
MUD_SHADES = ("#f1e8da", "#dfcfb6", "#c9b290")  # one after the other along the track
MUD, SURFACE = "#cdb48f", "#8a6d45"  # seen from the side
BODY = "#ece8e1"
FLIPPER_COLOURS = {"left": "#8fbfd2", "right": "#1f6f8b"}
TRAIL = "#b5462f"
FORWARD, UP, FORCE = "#7a5195", "#2f6db5", "#8e24aa"
OUTCOME_COLOURS = {
    Outcome.GOOD: "#2f7d4f",
    Outcome.SLIPPING: "#e0970c",
    Outcome.STUCK: "#c0392b",
    Outcome.UNKNOWN: INK,
}
