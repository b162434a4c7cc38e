#!/usr/bin/env python3
"""A data set made by a Ray cluster: one task a shard; Ray repeats a task whose worker dies.

    pip install ray
    python ray_dataset.py plan.toml /shared/set --shards 32            # on the cluster's head
    python ray_dataset.py plan.toml set --shards 8 --workers 2         # on this machine

Every worker needs insonify, a Vulkan driver and the folder. A shard that is begun again goes on where it was stopped,
and the set is the same bytes whoever made what. docs/datasets.md says what a plan is.
"""

import argparse

import ray


@ray.remote(num_cpus=1, max_retries=5)
def shard(plan: str, output: str, index: int, count: int) -> dict:
    import insonify

    return insonify.make_dataset(plan, output, shard=(index, count), resume=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plan")
    parser.add_argument("output")
    parser.add_argument("--shards", type=int, required=True)
    parser.add_argument("--workers", type=int, help="start Ray here, with so many workers at a time")
    args = parser.parse_args()
    ray.init(num_cpus=args.workers) if args.workers else ray.init(address="auto")
    running = [shard.remote(args.plan, args.output, i, args.shards) for i in range(args.shards)]
    done = 0
    while running:
        ready, running = ray.wait(running)
        for made in ray.get(ready):
            done += made["samples"]
            print(f"{args.shards - len(running)}/{args.shards} shards, {done} samples", flush=True)
    ray.shutdown()


if __name__ == "__main__":
    main()
