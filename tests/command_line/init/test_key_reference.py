from command_line.init.key_reference import configuration_keys, is_required


def test_every_key_has_a_meaning_and_every_number_bounds_and_a_unit() -> None:
    keys = list(configuration_keys())
    assert len(keys) > 130
    wrong = {
        f"{key.section}.{key.name}"
        for key in keys
        if not key.meaning or (key.kind in ("int", "float") and not (key.bounds and key.unit))
    }
    assert not wrong


def test_every_default_lies_within_its_bounds() -> None:
    bounded = [key for key in configuration_keys() if key.bounds and not is_required(key)]
    assert all(key.bounds and key.bounds.minimum <= key.default <= key.bounds.maximum for key in bounded)
