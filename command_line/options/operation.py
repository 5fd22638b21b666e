"""Options of the commands that operate the robot through its daemon."""

import argparse

from command_line.options.shared import add_config, add_json, add_socket

Parser = argparse.ArgumentParser


def add_status(status: Parser) -> None:
    add_socket(status)
    add_json(status)


def add_arm(arm: Parser) -> None:
    add_socket(arm)
    add_json(arm)
    arm.add_argument("--force", action="store_true", help="overrule failed checks that are not mandatory")
    _add_take_over(arm)


def add_walk(walk: Parser) -> None:
    from command_line.option_types import any_depth_cm, whole

    add_socket(walk)
    add_json(walk)
    depth = walk.add_mutually_exclusive_group()
    depth.add_argument("--depth", type=any_depth_cm, metavar="CM", help="insertion depth of every stride")
    depth.add_argument("--adaptive", action="store_true", help="choose the depth from the mud once a stride (default)")
    walk.add_argument("--strides", type=whole(1, 100000), default=0, metavar="N", help="stop after N (default: go on)")
    walk.add_argument("--attended", action="store_true", help="stay connected; the robot stops when this command ends")
    _add_take_over(walk)


def add_move(move: Parser) -> None:
    from command_line.option_types import joint_angle

    add_socket(move)
    add_json(move)
    move.add_argument("angles", type=joint_angle, nargs="+", metavar="JOINT=DEG", help="left_sweep=10 ...")
    _add_take_over(move)


def _add_take_over(parser: Parser) -> None:
    parser.add_argument("--take-over", action="store_true", help="take the lease from a program that holds it")


def add_stop(stop: Parser) -> None:
    add_socket(stop)
    add_json(stop)


def add_disarm(disarm: Parser) -> None:
    add_socket(disarm)
    add_json(disarm)


def add_clear(clear: Parser) -> None:
    add_socket(clear)
    add_json(clear)


def add_check(check: Parser) -> None:
    add_socket(check)
    add_json(check)
    add_config(check, "used without a daemon (default: %(default)s)")


def add_watch(watch: Parser) -> None:
    from command_line.option_types import between

    watch.add_argument("--lines", action="store_true", help="plain lines, as in a pipe, also on a terminal")
    watch.add_argument(
        "--period", type=between(0.05, 3600.0, "s"), metavar="S", help="seconds between two (default: 0.1; lines: 1)"
    )
    add_socket(watch)


def add_fail(fail: Parser) -> None:
    from command_line.option_types import finite

    add_socket(fail)
    add_json(fail)
    fail.add_argument("component", nargs="?", help="left_sweep, bus.left, pose ..., or all")
    fail.add_argument("kind", nargs="?", help="off, stuck, garbage, slow, intermittent ..., or ok to end the failure")
    fail.add_argument("--for", type=finite, default=2.0, metavar="S", dest="seconds", help="seconds until it ends")
    fail.add_argument("--list", action="store_true", help="list what can fail, how, and what fails now")
