"""The search of mapper-planner compared with LKH and OR-tools on the ordering problem without memory (fixed weights).

    python3 -m venv target/peers-venv && target/peers-venv/bin/pip install elkai ortools numpy
    target/peers-venv/bin/python benches/peers/planner_static.py

Prints one table: sum of the weights along the order, K, and wall time, s. All three get the same weights; an order may
begin and end anywhere (a point without weight closes the circle), and what is made large is turned into costs in
whole 1e-4 K for the peers. LKH comes with elkai, whose licence does not allow commercial use: a peer here, no dependency.
"""

import json
import subprocess
import sys
import time

import elkai
import numpy as np
from ortools.constraint_solver import pywrapcp, routing_enums_pb2

SCALE = 1e4


def costs(weight):
    """Costs in whole numbers with one point more, from and to which every way is free."""
    n = len(weight)
    cost = np.zeros((n + 1, n + 1), dtype=np.int64)
    cost[:n, :n] = np.round(SCALE * (weight.max() - weight))
    np.fill_diagonal(cost, 0)
    return cost


def opened(circle, n):
    """The order that the circle through the free point stands for."""
    circle = [i for i in circle[: n + 1]]
    place = circle.index(n)
    return circle[place + 1 :] + circle[:place]


def lkh(weight):
    n = len(weight)
    circle = elkai.DistanceMatrix(costs(weight).tolist()).solve_tsp(runs=1)
    return opened(circle, n)


def or_tools(weight, seconds):
    n = len(weight)
    table = costs(weight).tolist()
    manager = pywrapcp.RoutingIndexManager(n + 1, 1, n)
    routing = pywrapcp.RoutingModel(manager)
    transit = routing.RegisterTransitMatrix(table)
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    parameters.time_limit.FromSeconds(seconds)
    solution = routing.SolveWithParameters(parameters)
    index, circle = routing.Start(0), []
    while not routing.IsEnd(index):
        circle.append(manager.IndexToNode(index))
        index = solution.Value(routing.NextVar(index))
    return opened(circle, n)


def total(weight, order):
    assert sorted(order) == list(range(len(weight)))
    return sum(weight[i][j] for i, j in zip(order, order[1:]))


def main():
    print("| points | mapper K | s | LKH K | s | OR-tools K | s | mapper behind the best |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    command = ["cargo", "run", "--release", "--quiet", "-p", "mapper-planner", "--example", "static_problem", "--"]
    for points in [int(text) for text in sys.argv[1:]] or [50, 200, 500]:
        ours = json.loads(subprocess.run(command + [str(points)], check=True, capture_output=True).stdout)
        weight = np.array(ours["weight_k"])
        values = [total(weight, ours["order"])]
        seconds = [ours["seconds"]]
        # OR-tools' guided local search takes all the time it is given: as many seconds as this program, at least one.
        allowed = max(1, round(ours["seconds"]))
        for peer in (lkh, lambda weight: or_tools(weight, allowed)):
            started = time.perf_counter()
            order = peer(weight)
            seconds.append(time.perf_counter() - started)
            values.append(total(weight, order))
        behind = 100 * (1 - values[0] / max(values))
        cells = "".join(f" {value:.1f} | {took:.2f} |" for value, took in zip(values, seconds))
        print(f"| {points} |{cells} {behind:.3f} % |", flush=True)


if __name__ == "__main__":
    main()
