"""Learns a depth policy in the simulator, and compares it with constant depths and with the robot's own method.

pip install gymnasium
python examples/learn_depth.py             # minutes on two processors

The policy is linear in what the robot feels: depth = tanh(w · (1, ln k_s, ln k_e)). Its weights are found by the
cross-entropy method: draw some, keep the best quarter, draw the next around them. It never sees the tracks of the test.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import gymnasium
import numpy as np

DURATION_S, CANDIDATES, ELITE = 40.0, 12, 3
LEAST_K = 0.01  # N/cm³, where none is known


def reward(policy, seed, adaptive=False):
    """Return the reward of a walk over the track of this seed."""
    walk = gymnasium.make(
        "mudskipper.gym:mudskipper/MudWalk-v0", backend="direct", duration_s=DURATION_S, adaptive=adaptive
    )
    felt, _ = walk.reset(seed=seed)
    rewards, over = [], False
    while not over:
        felt, gained, fault, done, _ = walk.step(np.array([policy(felt), 0.5, 0.0], np.float32))
        rewards.append(gained)
        over = fault or done
    return np.sum(rewards)


def linear(weights, felt):
    known = np.log(np.maximum(felt[1:3], LEAST_K))
    return np.tanh(weights @ [1.0, *known])


def constant(depth, felt):
    return depth


def mean_rewards(pool, policies, seeds, adaptive=False):
    """Return the mean reward of each policy over the tracks."""
    jobs = [pool.submit(reward, policy, seed, adaptive) for policy in policies for seed in seeds]
    return np.reshape([job.result() for job in jobs], (len(policies), len(seeds))).mean(axis=1)


def main(generations=4, tracks=8):
    random = np.random.default_rng(1)
    mean, spread = np.zeros(3), np.full(3, 0.7)
    with ProcessPoolExecutor() as pool:
        for generation in range(generations):
            weights = random.normal(mean, spread, (CANDIDATES, 3))
            rewards = mean_rewards(
                pool, [partial(linear, each) for each in weights], [2 * generation, 2 * generation + 1]
            )
            best = weights[np.argsort(rewards)[-ELITE:]]
            mean, spread = best.mean(axis=0), best.std(axis=0) + 0.1
            print(f"generation {generation}: best {rewards.max():.0f}, mean {rewards.mean():.0f}", flush=True)
        seeds = range(1000, 1000 + tracks)
        depths = np.linspace(-1.0, 1.0, 5)
        constants = mean_rewards(pool, [partial(constant, depth) for depth in depths], seeds)
        (learned,) = mean_rewards(pool, [partial(linear, mean)], seeds)
        (own,) = mean_rewards(pool, [partial(constant, 0.0)], seeds, adaptive=True)
    print(f"constant depths of 1 to 4.5 cm: {', '.join(f'{each:.0f}' for each in constants)}")
    print(f"learned: {learned:.0f}   the robot's own method, with its own sweep: {own:.0f}   (reward of a walk)")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
