"""The codec of MIT mode against the encoders and decoders of two published libraries."""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import pytest

from drivers.can.frames import MalformedMessageError
from drivers.mit import codec
from drivers.mit.codec import Answer
from drivers.mit.models import MODELS, TORQUE_CODES

damiao = pytest.importorskip("damiao_motor.core.motor", reason="the package damiao-motor, an oracle, is not installed")
RANDOM_FRAMES = 1_000
DAMIAO = {f"DM{name}": name for name in damiao.MOTOR_TYPE_PRESETS}


class Silent:
    """A bus that the package needs, which sends nothing."""


def motor(model: str) -> Any:
    return damiao.DaMiaoMotor(1, 17, Silent(), motor_type=DAMIAO[model])


def tmotor_tables() -> Mapping[str, Any]:
    """Return the package's MIT_Params from its source, because creating its manager would run sudo."""
    spec = find_spec("TMotorCANControl")
    if spec is None or spec.origin is None:
        pytest.skip("the package TMotorCANControl is not installed")
    source = (Path(spec.origin).parent / "mit_can.py").read_text(encoding="utf-8")
    begin = source.index("MIT_Params = {")
    scope: dict[str, Any] = {}
    exec(source[begin : source.index('"""', begin)], scope)  # the dictionary alone
    return {name: table for name, table in scope["MIT_Params"].items() if name != "ERROR_CODES"}


def tmotor_code(x: float, limit: float, bits: int) -> int:
    """Encode as TMotorCANControl 1.2.6 does: by 2ⁿ, truncated, two steps short of the upper end."""
    ratio = float((1 << bits) / (2.0 * limit))
    x = min(max(x, -limit), limit - 2.0 / ratio)
    return int((x + limit) * ratio)


def test_the_ranges_are_those_of_the_libraries() -> None:
    for model, name in DAMIAO.items():
        preset = damiao.MOTOR_TYPE_PRESETS[name]
        assert MODELS[model][:3] == (preset["p_max"], preset["v_max"], preset["t_max"])
        assert MODELS[model].has_registers
    tables = tmotor_tables()
    for name, table in tables.items():
        velocity_rad_s = 45.0 if name == "AK60-6" else table["V_max"]  # the makers' manual V1.0.8, page 50
        assert MODELS[name][:3] == (table["P_max"], velocity_rad_s, table["T_max"])
        assert not MODELS[name].has_registers
    robstrides = {name for name, model in MODELS.items() if model.reports_faults_apart}
    assert set(MODELS) == set(DAMIAO) | set(tables) | robstrides


def test_a_robstride_answers_with_a_wide_temperature_and_reports_its_faults_apart() -> None:
    """Bytes by section 6 of the User Manuals: half of each range at 37.5 °C; two faults, one, none, an unknown one."""
    ranges = MODELS["RS00"]
    answer = codec.decode_answer(bytes.fromhex("05 c000 c00c 00 0177"), ranges)
    assert answer.node_id == 5 and (answer.temperature_c, answer.last) == (37.5, 0)
    assert answer.position_rad == pytest.approx(0.5 * 12.57, abs=1e-3)
    assert answer.velocity_rad_s == pytest.approx(0.5 * 33.0, abs=0.025)
    assert answer.torque_nm == pytest.approx(0.5 * 14.0, abs=0.01)
    assert codec.encode_answer(answer, ranges) == bytes.fromhex("05 c000 c00c 00 0177")
    for temperature_c in (-12.5, 0.0, 25.6, 145.0):
        given = codec.encode_answer(answer._replace(temperature_c=temperature_c), ranges)
        assert codec.decode_answer(given, ranges).temperature_c == temperature_c and not codec.is_faults(given)
    reported = bytes.fromhex("05 0140 0000 000000")  # bits 0 and 14
    assert codec.is_faults(reported) and codec.error_text(codec.decode_faults(reported)) == "over-temperature"
    assert codec.decode_faults(bytes.fromhex("05 0000 0100 000000")) == 2  # bit 16, over-current
    assert codec.decode_faults(bytes.fromhex("05 0000 0000 000000")) == 0
    assert codec.error_text(codec.decode_faults(bytes.fromhex("05 0000 0080 000000")))  # a bit without a name


def test_the_other_commands_are_those_of_the_library() -> None:
    assert codec.ENTER == damiao.DaMiaoMotor.encode_enable_msg() == bytes.fromhex("fffffffffffffffc")
    assert codec.LEAVE == damiao.DaMiaoMotor.encode_disable_msg() == bytes.fromhex("fffffffffffffffd")
    assert codec.SET_ZERO == damiao.DaMiaoMotor.encode_save_position_zero_msg() == bytes.fromhex("fffffffffffffffe")
    assert codec.CLEAR == damiao.DaMiaoMotor.encode_clear_error_msg() == bytes.fromhex("fffffffffffffffb")


def test_no_code_is_zero_torque_and_the_nearest_is_taken() -> None:
    """Both libraries decode the code of zero to half a step."""
    for model in MODELS.values():
        code = int.from_bytes(codec.encode_torque(0.0, model.torque_nm)[6:], "big")
        decoded_nm = damiao.uint_to_float(code, -model.torque_nm, model.torque_nm, 12)
        assert decoded_nm == pytest.approx(0.5 * model.torque_step_nm, abs=1e-9)
        below_nm = damiao.uint_to_float(code - 1, -model.torque_nm, model.torque_nm, 12)
        assert abs(below_nm) == pytest.approx(abs(decoded_nm), abs=1e-9)
    assert damiao.float_to_uint(0.0, -18.0, 18.0, 12) == 2047
    assert tmotor_code(0.0, 18.0, 12) == 2048 == codec.ZERO_CODE


def test_random_torques_are_the_code_nearest_to_them() -> None:
    """The library truncates, so its code is ours or the one below; TMotorCANControl's is at most one from ours."""
    random, models = Random(1), list(DAMIAO)
    motors = {model: motor(model) for model in models}
    for _ in range(RANDOM_FRAMES):
        model = random.choice(models)
        limit_nm, step_nm = MODELS[model].torque_nm, MODELS[model].torque_step_nm
        torque_nm = random.choice([random.uniform(-1.2, 1.2) * limit_nm, random.gauss(0.0, step_nm)])
        data = codec.encode_torque(torque_nm, limit_nm)
        code = data[6] << 8 | data[7]
        theirs = motors[model].encode_cmd_msg(0.0, 0.0, torque_nm, 0.0, 0.0)
        their_code = (theirs[6] & 0xF) << 8 | theirs[7]
        assert code - their_code in (0, 1)
        assert theirs[3] & 0xF == theirs[4] == theirs[5] == theirs[6] >> 4 == 0 == data[4] == data[5] == data[6] >> 4
        assert abs(code - tmotor_code(torque_nm, limit_nm, 12)) <= 1
        clipped_nm = min(max(torque_nm, -limit_nm), limit_nm)
        decoded_nm = damiao.uint_to_float(code, -limit_nm, limit_nm, 12)
        assert abs(decoded_nm - clipped_nm) <= (0.5 + 1e-9) * step_nm
        gate_nm = codec.decode_torque(data, limit_nm)
        assert abs(gate_nm - (0.0 if code == codec.ZERO_CODE else decoded_nm)) <= 1e-9 * limit_nm


def test_random_answers_are_decoded_as_by_the_library_but_in_the_middle_of_the_step() -> None:
    random, models = Random(2), list(DAMIAO)
    motors = {model: motor(model) for model in models}
    for _ in range(RANDOM_FRAMES):
        model = random.choice(models)
        data = bytes([random.randrange(256)]) + random.randbytes(7)
        ours, ranges = codec.decode_answer(data, MODELS[model]), MODELS[model]
        theirs = motors[model].decode_sensor_feedback(data, 17)
        assert (ours.node_id, ours.status) == (data[0] & 0xF, theirs["status_code"])
        half_rad, half_rad_s = ranges.position_rad / 65535, ranges.velocity_rad_s / TORQUE_CODES
        assert abs(ours.position_rad - theirs["pos"] - half_rad) < 1e-9
        assert abs(ours.velocity_rad_s - theirs["vel"] - half_rad_s) < 1e-9
        assert abs(ours.torque_nm - theirs["torq"] - 0.5 * ranges.torque_step_nm) < 1e-9
        assert (ours.temperature_c, ours.last) == (theirs["t_mos"], theirs["t_rotor"])


@pytest.mark.parametrize("size", [0, 6, 7, 9])
def test_answers_of_another_length_are_malformed(size: int) -> None:
    with pytest.raises(MalformedMessageError, match=f"{size} bytes"):
        codec.decode_answer(bytes(size), MODELS["AK80-9"])
    with pytest.raises(MalformedMessageError, match=f"{size} bytes"):
        codec.decode_register(bytes(size))


def test_register_answers_are_recognised_as_by_the_library() -> None:
    data = codec.encode_register(3, codec.READ, 9, (2000).to_bytes(4, "little"))
    assert damiao.is_register_reply(data) and codec.is_register_answer(data, 3)
    assert not codec.is_register_answer(data, 4)
    assert codec.decode_register(data) == (3, codec.READ, 9, (2000).to_bytes(4, "little"))
    enabled = codec.encode_answer(Answer(3, codec.ENABLED, -12.48, 0.0, 0.0, 30.0, 31), MODELS["DM4310"])
    assert not codec.is_register_answer(enabled, 3)
