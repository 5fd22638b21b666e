"""The folder of a simulated robot is private: files that another user prepared are neither used nor followed."""

import os
import pwd
import stat
from pathlib import Path

import pytest

from drivers.can import run_folder as module
from drivers.can.run_folder import LINK, NAME, find_run_folder, make_own_folder, run_folder, write_private_file

OTHER_USER = 54321
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root makes files that are another user's")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the home folder of a user without a runtime folder."""
    folder, temporary = tmp_path / "home", tmp_path / "tmp"
    folder.mkdir()
    temporary.mkdir()
    temporary.chmod(0o1777)
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setattr(module, "_runtime_parents", list)
    return folder


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    monkeypatch.setattr(module, "_runtime_parents", lambda: [folder])
    return folder


def test_the_runtime_folder_of_the_environment_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    with monkeypatch.context() as environment:
        environment.setenv("XDG_RUNTIME_DIR", "/somewhere")
        assert module._runtime_parents()[0] == Path("/somewhere")
        environment.setenv("XDG_RUNTIME_DIR", "relative")
        assert Path("relative") not in module._runtime_parents()


def test_the_folder_lies_in_the_runtime_folder_and_every_process_finds_it(runtime: Path) -> None:
    assert find_run_folder() != runtime / NAME
    assert run_folder() == run_folder() == find_run_folder() == runtime / NAME
    assert stat.S_IMODE((runtime / NAME).stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770])
def test_a_runtime_folder_that_others_may_write_to_is_not_used(runtime: Path, mode: int) -> None:
    runtime.chmod(mode)
    assert runtime not in (run_folder().parent, run_folder().parent.parent)


@as_root
@pytest.mark.parametrize("level", ["runtime", "above"])
def test_a_runtime_folder_below_one_of_another_user_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: str
) -> None:
    above = tmp_path / "above"
    (above / "runtime").mkdir(parents=True)
    os.chown(above if level == "above" else above / "runtime", OTHER_USER, OTHER_USER)
    monkeypatch.setattr(module, "_runtime_parents", lambda: [above / "runtime"])
    assert not run_folder().is_relative_to(above)


@as_root
def test_a_folder_that_another_user_prepared_is_refused(runtime: Path) -> None:
    (runtime / NAME).mkdir()
    os.chown(runtime / NAME, OTHER_USER, OTHER_USER)
    with pytest.raises(PermissionError, match="belongs to user 54321"):
        run_folder()


def test_a_link_in_place_of_a_folder_is_refused(runtime: Path, tmp_path: Path) -> None:
    (tmp_path / "target").mkdir()
    (runtime / NAME).symlink_to(tmp_path / "target")
    with pytest.raises(NotADirectoryError):
        run_folder()
    with pytest.raises(NotADirectoryError):
        make_own_folder(runtime / NAME)


def test_an_own_folder_that_others_may_write_to_is_refused(runtime: Path) -> None:
    run_folder().chmod(0o777)
    with pytest.raises(PermissionError, match="chmod go-w"):
        run_folder()


def test_a_file_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine", encoding="utf-8")
    (tmp_path / "link").symlink_to(tmp_path / "precious")
    with pytest.raises(OSError):
        write_private_file(tmp_path / "link", "theirs")
    write_private_file(tmp_path / "new", "text")
    assert (tmp_path / "precious").read_text(encoding="utf-8") == "mine"
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o600


def test_without_a_runtime_folder_a_new_one_is_found_through_the_home_folder(home: Path) -> None:
    assert find_run_folder() is None
    made = run_folder()
    assert made == run_folder() == find_run_folder() == (home / LINK).resolve()
    assert stat.S_IMODE(made.stat().st_mode) == 0o700 and made.parent.name == "tmp"
    made.rmdir()
    assert run_folder() != made  # after a restart of the computer


def test_a_link_to_an_unsafe_folder_is_replaced(home: Path, tmp_path: Path) -> None:
    unsafe = tmp_path / "tmp" / "prepared"
    unsafe.mkdir()
    unsafe.chmod(0o777)
    (home / LINK).parent.mkdir(parents=True)
    (home / LINK).symlink_to(unsafe)
    assert run_folder() != unsafe
    assert (home / LINK).resolve() == run_folder()


def test_a_user_without_a_home_has_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(number: int) -> None:
        raise KeyError(number)

    monkeypatch.delenv("HOME")
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert find_run_folder() is None
    with pytest.raises(OSError, match="XDG_RUNTIME_DIR"):
        run_folder()
