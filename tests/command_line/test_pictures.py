"""`mudskipper plot` and `mudskipper film`: the files, the drawn values and the refused options."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

from command_line.logs import log_commands
from experiments.pictures import stride_film
from experiments.pictures.mud_layout import describe_mud, layout_of_track, mud_regions
from experiments.pictures.recorded_walk import RecordedWalk, read_walk
from experiments.pictures.stride_choice import Outcome, duration_s
from experiments.pictures.stride_film import FRAMES_PER_S, film_frames
from experiments.pictures.walk_plot import draw_walk
from experiments.reports.style import OUTCOME_COLOURS, save_picture
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track
from tests.command_line.command_lines import failure, output, refusal, run
from tests.full_disk import files_of_at_most


def png_size(path: Path) -> tuple[int, int]:
    """Decode the whole picture and return its size."""
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        picture.load()
        return picture.size


@pytest.fixture
def log(two_walks: Path, tmp_path: Path) -> Path:
    """Copy the log into a folder of its own."""
    return Path(shutil.copy(two_walks, tmp_path / "two.mcap"))


@pytest.fixture(scope="module")
def walk(two_walks: Path) -> RecordedWalk:
    """Read the first walk."""
    return read_walk(two_walks, 1)


# files


@pytest.mark.parametrize(("command", "name", "width"), [("plot", "two.png", 1200), ("film", "two-strides.png", 1440)])
def test_a_picture_of_the_last_walk_is_written_next_to_its_log(command: str, name: str, width: int, log: Path) -> None:
    ended = run(command, str(log))
    assert png_size(log.with_name(name))[0] == width
    assert str(log.with_name(name)) in ended.stdout and "last of 2 walks" in ended.stderr


def test_a_plot_can_have_other_names_and_formats(two_walks: Path, tmp_path: Path) -> None:
    for name, start in (("figure.svg", b"<?xml"), ("figure.pdf", b"%PDF")):
        output("plot", str(two_walks), "--walk", "1", "--out", str(tmp_path / name))
        assert (tmp_path / name).read_bytes().startswith(start)


def test_a_strip_has_a_row_for_each_stride_asked_for(two_walks: Path, tmp_path: Path) -> None:
    heights = []
    for strides in ("--stride 0", "--stride 0 --stride 1", "--stride 1 --stride 0 --stride 1"):
        path = tmp_path / "strip.png"
        output("film", str(two_walks), "--walk", "1", *strides.split(), "--out", str(path))
        heights.append(png_size(path)[1])
    rows = np.diff(heights)
    assert rows[0] > 100 and abs(rows[1] - rows[0]) < 0.1 * rows[0]  # rounding; each row is as wide as the widest


def test_a_film_runs_in_real_time_for_ever(two_walks: Path, walk: RecordedWalk, tmp_path: Path) -> None:
    path = tmp_path / "walk.gif"
    output("film", str(two_walks), "--walk", "1", "--stride", "1", "--out", str(path))
    with Image.open(path) as film:
        assert (film.format, film.info["loop"]) == ("GIF", 0)
        shown_ms = 0
        for number in range(getattr(film, "n_frames", 1)):
            film.seek(number)
            film.load()
            shown_ms += film.info["duration"]
    frames = len(film_frames(walk, [walk.own_strides[1]]))
    assert shown_ms == 1000 * frames // FRAMES_PER_S  # equal frames are merged and their times added
    assert abs(shown_ms / 1000.0 - duration_s(walk, walk.own_strides[1])) <= 1.0 / FRAMES_PER_S


# drawn values


@pytest.fixture(scope="module")
def figure(walk: RecordedWalk) -> Figure:
    return draw_walk(walk)


def panel(figure: Figure, label: str) -> Axes:
    (found,) = [axes for axes in figure.axes if label in axes.get_ylabel()]
    return found


def row_of(figure: Figure, label: str) -> list[Axes]:
    """Return the panels of the left and the right flipper."""
    row = panel(figure, label).get_gridspec(), panel(figure, label).get_subplotspec()
    assert row[1] is not None
    return [axes for axes in figure.axes if (spec := axes.get_subplotspec()) and spec.rowspan == row[1].rowspan]


def test_the_plot_shows_the_logs_own_numbers(walk: RecordedWalk, figure: Figure) -> None:
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for axes in figure.axes for line in axes.lines}
    np.testing.assert_array_equal(lines["$f_z$ up"], walk.force_z_n)
    np.testing.assert_array_equal(lines["commanded"], 100.0 * walk.depth_command_m)
    chosen_cm = [100.0 * stride["chosen_depth_m"] for stride in walk.own_strides]
    np.testing.assert_array_equal(lines["chosen for the next stride"], chosen_cm)
    (bars,) = [each for each in panel(figure, "step").collections if each.get_label() == Outcome.GOOD]
    assert [path.get_extents().y1 for path in bars.get_paths()] == pytest.approx(
        [100.0 * stride["step_m"] for stride in walk.own_strides]
    )


@pytest.mark.parametrize("name", ["k_p", "k_s", "k_e"])
def test_bars_of_a_coefficient_are_two_standard_errors(walk: RecordedWalk, figure: Figure, name: str) -> None:
    reported = [s for flipper in (0, 1) for s in walk.strides if s["flipper"] == flipper and np.isfinite(s[name])]
    marks = [each for axes in row_of(figure, f"${name}$") for each in axes.containers]
    bars = [bar[:, 1] for mark in marks for bar in mark[2][0].get_segments()]
    assert len(reported) == len(bars) > 1
    for stride, (low, high) in zip(reported, bars, strict=True):
        assert (high + low) / 2.0 == pytest.approx(stride[name] / 1e6)
        assert (high - low) / 4.0 == pytest.approx(stride[f"{name}_std_error"] / 1e6)


def test_an_invalid_value_does_not_hide_the_valid_ones(walk: RecordedWalk) -> None:
    first, *others = walk.strides
    wild = first | {"k_p": 1e9, "k_p_valid": False}
    usual, hollow = draw_walk(walk), draw_walk(walk._replace(strides=[wild, *others]))
    assert panel(hollow, "$k_p$").get_ylim()[1] <= panel(usual, "$k_p$").get_ylim()[1]
    heights = [np.asarray(mark[0].get_ydata()) for axes in row_of(hollow, "$k_p$") for mark in axes.containers]
    drawn = np.concatenate(heights)
    assert len(drawn) == len(walk.strides) and max(drawn) < panel(hollow, "$k_p$").get_ylim()[1]


def test_failed_strides_are_marked(walk: RecordedWalk) -> None:
    """A mark shows where a flipper was stuck when its stride closed; slipping and stuck strides have coloured bars.

    The body's stride is stuck if either flipper was.
    """
    slipping, stuck = walk.own_strides[0] | {"step_m": 0.01}, walk.own_strides[1] | {"released": False}
    slipping["released"] = True
    left_stuck = draw_walk(walk._replace(strides=[slipping, stuck | {"released": True}, stuck | {"flipper": 0}]))
    assert Outcome.STUCK in panel(left_stuck, "step").get_legend_handles_labels()[1]
    figure = draw_walk(walk._replace(strides=[slipping, stuck]))
    (mark,) = [line for line in row_of(figure, "depth")[1].lines if line.get_label() == "stuck"]
    row = int(np.searchsorted(walk.time_s, stuck["stamp_s"]))
    assert np.asarray(mark.get_xdata()) == pytest.approx([stuck["stamp_s"]])
    assert np.asarray(mark.get_ydata()) == pytest.approx([100.0 * walk.depth_m[row]])
    handles, labels = panel(figure, "step").get_legend_handles_labels()
    bars = dict(zip(labels, handles, strict=True))
    for outcome, stride in ((Outcome.SLIPPING, slipping), (Outcome.STUCK, stuck)):
        assert to_hex(bars[outcome].get_facecolor()[0]) == OUTCOME_COLOURS[outcome]
        assert bars[outcome].get_paths()[0].get_extents().x0 == pytest.approx(stride["t_start_s"])


def test_without_a_pose_or_on_a_fixed_base_there_are_no_panels_of_position(walk: RecordedWalk) -> None:
    for each in (walk._replace(body_x_m=np.full(len(walk.time_s), np.nan)), walk._replace(fixed_base=True)):
        labels = [axes.get_ylabel().split()[0] for axes in draw_walk(each).axes if axes.get_ylabel()]
        assert labels == ["force", "$k_p$", "$k_s$", "$k_e$", "depth"]


@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")  # another test may have left a file open
def test_strides_without_usable_estimates_are_drawn(walk: RecordedWalk, tmp_path: Path) -> None:
    """Estimates may be NaN, infinite, negative, or missing in a walk without duration."""
    values = ((np.nan, np.nan), (np.inf, 1.0), (1e6, np.inf), (-1e6, 1.0))
    wild = [
        stride | {"k_p": value, "k_p_std_error": std_error}
        for stride, (value, std_error) in zip(walk.strides, values, strict=True)
    ]
    for each in (walk._replace(strides=wild), walk._replace(strides=[], time_s=np.zeros(len(walk.time_s)))):
        draw_walk(each).savefig(tmp_path / "small.png", dpi=10)


def test_muds_are_shaded_where_the_robot_said_so_and_described_by_their_k_p(walk: RecordedWalk) -> None:
    name = describe_mud(walk.strides)
    k_p = float(np.median([stride["k_p"] for stride in walk.strides])) / 1e6
    assert float(name.split()[1]) == pytest.approx(k_p, rel=0.05) and name.endswith("N/cm³")
    assert mud_regions(walk, None) == [(0.0, walk.time_s[-1], name)]
    second = walk.own_strides[1]
    soft = [stride | {"k_p": 0.2e6} if stride["index"] else stride for stride in walk.strides]
    noticed = walk._replace(noticed_s=[second["stamp_s"]], strides=soft)
    assert mud_regions(noticed, None) == [
        (0.0, second["t_start_s"], describe_mud(walk.strides[:2])),
        (second["t_start_s"], walk.time_s[-1], "k_p 0.20 N/cm³"),
    ]


@pytest.mark.parametrize("is_backward", [False, True])
def test_muds_of_a_known_track_are_shaded_from_arrival_to_arrival(walk: RecordedWalk, is_backward: bool) -> None:
    position_m, borders_m = np.linspace(0.0, 0.5, len(walk.time_s)), [0.0, 0.1, 0.4, 0.5]
    names = ["w = 48.5 %", "w = 53.1 %", "900 Pa"]  # the last one was not reached
    if is_backward:
        position_m, borders_m, names = position_m[::-1], borders_m[::-1], names[::-1]
    track = Track([(0.1, MUDS["48.5"]), (0.3, MUDS["53.1"]), (0.3, Clay("900 Pa", 900.0)), (0.3, MUDS["48.5"])])
    regions = mud_regions(walk._replace(body_x_m=position_m), layout_of_track(track))
    assert [name for *_, name in regions] == names
    borders_s = [walk.time_s[np.argmin(np.abs(position_m - border_m))] for border_m in borders_m]
    np.testing.assert_allclose([start for start, *_ in regions], borders_s[:3], atol=0.003)  # one tick
    assert regions[-1][1] == walk.time_s[-1]


def test_a_full_disk_leaves_the_picture_before(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    save_picture(Figure, path)
    before = path.read_bytes()
    with files_of_at_most(100), pytest.raises(OSError, match="File too large"):
        save_picture(Figure, path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


# refused options


@pytest.mark.parametrize("command", ["plot", "film"])
def test_an_unknown_walk_and_an_unwritable_file_are_refused(command: str, two_walks: Path, tmp_path: Path) -> None:
    assert "no walk 3, only 2" in failure(command, str(two_walks), "--walk", "3")
    out = tmp_path / "nowhere" / "x.png"
    assert f"{out} cannot be written" in failure(command, str(two_walks), "--out", str(out))


def test_a_film_of_strides_that_are_not_there_or_without_end_is_refused(
    two_walks: Path, walk: RecordedWalk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = ("film", str(two_walks), "--walk", "1", "--out", str(tmp_path / "walk.gif"))
    assert "--stride 2: this walk has 0 to 1" in refusal(*film, "--stride", "0", "--stride", "2")
    monkeypatch.setattr(log_commands, "LONGEST_FILM_S", 2.0)
    monkeypatch.setattr(stride_film, "FRAMES_PER_S", 2)
    assert "choose with --stride" in refusal(*film)
    output(*film, "--stride", "1")
    monkeypatch.setattr(log_commands, "read_walk", lambda *_: walk._replace(strides=[]))
    assert "no complete stride" in failure(*film)
