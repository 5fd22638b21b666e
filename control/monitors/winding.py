"""The temperature of a motor's winding, estimated from its current, because sensors are slow or absent.

The model is one heat capacity, heated by the copper loss and cooled by the room:

    τ dT/dt = R_th P + T_room - T        P = 3/2 R (1 + 0.0039 (T - 25 °C)) i_q²

with i_q the peak of the phase current, as ODrive and moteus report it; 0.0039 per kelvin is copper's coefficient. The
resistance is the R60's; its thermal resistance is a placeholder in the only public source, and the time constant is a
low estimate: measure your motors. A sensor that reads higher corrects the model. Both are clipped at HOTTEST_C, because
the model would take hours to cool from one absurd reading.
"""

from math import isfinite

from control.parameters.winding_parameters import WindingParameters

COPPER_PER_K = 0.0039
REFERENCE_C = 25.0
HOTTEST_C = 250.0  # enamel has burnt by then


class Winding:
    """Owns one winding's temperature."""

    def __init__(self, parameters: WindingParameters) -> None:
        self._room_c, self._time_constant_s = parameters.room_c, parameters.time_constant_s
        self._resistance_ohm = parameters.resistance_ohm
        self._rise_k_w = parameters.thermal_resistance_k_w * 1.5
        self.reset()

    def reset(self) -> None:
        self.temperature_c = self._room_c

    def update(self, dt_s: float, current_a: float, measured_c: float) -> float:
        """Advance the model and return the temperature, the higher of model and sensor; a NaN current adds no heat."""
        temperature_c = self.temperature_c
        rise_k = 0.0
        if isfinite(current_a):
            resistance_ohm = self._resistance_ohm * (1.0 + COPPER_PER_K * (temperature_c - REFERENCE_C))
            rise_k = self._rise_k_w * resistance_ohm * current_a * current_a
        temperature_c += (self._room_c + rise_k - temperature_c) * dt_s / (self._time_constant_s + dt_s)
        if measured_c > temperature_c:  # never true of NaN
            temperature_c = measured_c
        self.temperature_c = temperature_c = HOTTEST_C if temperature_c > HOTTEST_C else temperature_c
        return temperature_c
