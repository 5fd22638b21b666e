"""Learns a depth policy in the simulator, and compares it with constant depths and with the robot's own method.

pip install gymnasium
python examples/learn_depth.py             # minutes on two processors

The robot walks some tracks at random depths. What a stride earns in a second is fitted as a polynomial in its depth and
in ln k_p, which the stride before felt; the policy takes the depth that earns most by it. It never sees the tracks of
the test.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import gymnasium
import numpy as np

DURATION_S = 40.0
LEAST_K_P = 0.01  # N/cm³, where none is known
DEPTHS = np.linspace(-1.0, 1.0, 41)  # as actions


def walk_track(seed, choose, adaptive=False):
    """Walk over the track of this seed; return (k_p felt before, depth, reward, duration in s) of each stride."""
    walk = gymnasium.make(
        "mudskipper.gym:mudskipper/MudWalk-v0", backend="direct", duration_s=DURATION_S, adaptive=adaptive
    )
    felt, _ = walk.reset(seed=seed)
    random, strides, over = np.random.default_rng(seed), [], False
    while not over:
        k_p, depth = felt[0], choose(felt[0], random)
        felt, reward, fault, done, info = walk.step(np.array([depth, 0.5, 0.0], np.float32))
        strides.append((k_p, depth, reward, info["duration_s"]))
        over = fault or done
    return strides


def at_random(k_p, random):
    return random.uniform(-1.0, 1.0)


def constant(depth, k_p, random):
    return depth


def best_by(coefficients, k_p, random):
    return DEPTHS[np.argmax(terms(k_p, DEPTHS) @ coefficients)]


def terms(k_p, depth):
    """Return the terms of the polynomial: 1, depth and depth², each times 1, x, x² and x³ of x = ln k_p."""
    x = np.log(np.maximum(k_p, LEAST_K_P))
    return np.stack([depth**i * x**j for i in range(3) for j in range(4)], axis=-1)


def learn(pool, tracks):
    strides = np.concatenate(list(pool.map(partial(walk_track, choose=at_random), range(tracks))))
    k_p, depth, reward, duration_s = strides.T
    coefficients, *_ = np.linalg.lstsq(terms(k_p, depth), reward / duration_s)
    print(f"learned from {len(strides)} strides over {tracks} tracks", flush=True)
    return partial(best_by, coefficients)


def mean_reward(pool, tracks, choose, adaptive=False):
    """Return the mean reward of a walk over the tracks of the test."""
    walks = pool.map(partial(walk_track, choose=choose, adaptive=adaptive), range(1000, 1000 + tracks))
    return np.mean([sum(reward for _, _, reward, _ in walk) for walk in walks])


def main(learning=24, testing=8):
    with ProcessPoolExecutor() as pool:
        policy = learn(pool, learning)
        constants = [mean_reward(pool, testing, partial(constant, depth)) for depth in np.linspace(-1.0, 1.0, 5)]
        print(f"constant depths of 1 to 5 cm: {', '.join(f'{each:.0f}' for each in constants)}", flush=True)
        learned = mean_reward(pool, testing, policy)
        own = mean_reward(pool, testing, partial(constant, 0.0), adaptive=True)
    print(f"learned: {learned:.0f}   the robot's own method: {own:.0f}   (reward of a walk of {DURATION_S:.0f} s)")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
