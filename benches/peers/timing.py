"""The statistic of all times in the table of run.sh, for ours and for every other program: the median
of samples of processor time. `benches/src/timing.rs` is the same for ours.

Usage: python benches/peers/timing.py NUMBER...   prints the statistic of samples, for a test.
"""

import statistics
import sys
import time

SAMPLE_S, BUDGET_S, LEAST, MOST = 100e-6, 0.2, 5, 101


def statistic(samples):
    """Returns the median; of an even number of samples the upper of the middle two, as ours."""
    return statistics.median_high(samples)


def plan(call_s):
    """Returns the number of samples, and of calls in each."""
    call_s = max(call_s, 1e-9)
    calls = max(1, -int(-SAMPLE_S // call_s))
    return min(max(int(BUDGET_S / (calls * call_s)), LEAST), MOST) | 1, calls


def time_once(call, calls=1):
    """Returns the processor time of one of so many calls, s."""
    start = time.process_time()
    for _ in range(calls):
        call()
    return (time.process_time() - start) / calls


def median_s(call):
    """Returns the median processor time of a call, s."""
    time_once(call)
    samples, calls = plan(time_once(call, 3))
    return statistic([time_once(call, calls) for _ in range(samples)])


def rows(rounds):
    """Returns rows (ours, theirs, ratio) by job: medians over rounds, of the ratio as well."""
    table = {}
    for job, times in rounds.items():
        ours, theirs = (statistic(side) for side in zip(*times))
        table[job] = ours, theirs, statistic([their / our for our, their in times])
    return table


if __name__ == "__main__":
    print(statistic([float(word) for word in sys.argv[1:]]))
