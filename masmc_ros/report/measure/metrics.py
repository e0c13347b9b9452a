# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Metrics of a run.

Chatter is the share of the ticks at which the torque of a joint reverses its change. Changes from
tick to tick count if they exceed 5 % of the torque limit, or without a limit 5 % of the largest
torque of the run. A reversal is such a change whose sign is opposite to that of the one before it.
An oscillation of period p ticks with a sufficient amplitude has a share of 2/p. Torques that
follow a path, and small noise, have no reversals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
import math
from typing import Any, NamedTuple

from masmc_ros.aliases import Array, Flags
from masmc_ros.control.supervisor import Mode
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.controller_events import ACTIVATED, DEACTIVATED, GUIDED, RESUMED
from masmc_ros.loop.signals import largest_slip, least_normal_force
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.labels import as_line
from masmc_ros.report.measure.parameters import ParameterChange, run_changes
from masmc_ros.report.measure.tracking import settling_time, Tracking, tracking
from masmc_ros.robot.declaration import Coordinate, listed, Point
import numpy as np

_AMPLITUDE = 0.05
"""Part of the limit from which a change counts."""

_SHARE = 0.2
"""Share of the ticks from which a joint chatters: an oscillation with 10 ticks per period."""

_FEWEST_TICKS = 20
"""Smallest number of ticks from which a share is computed."""

_REMEDY = (
    'expected switching implicit or tanh, lower gains, a larger gamma of an adaptive law, or a'
    ' shorter control_period'
)
_NOISY = (
    'the noise of the measured velocities contributes to it; expected lower gains, or a smaller'
    ' velocity_noise'
)

_ROUNDING = 1.0e-6
"""Torque in N·m or N below which changes are rounding errors."""


def reversal_shares(torque: Array, scale: Array) -> Array:
    """
    Return the shares of reversals (joints) in [0, 1].

    Parameters
    ----------
    torque
        Torques (n, joints) of consecutive ticks in N·m or N.
    scale
        Torque limits (joints), or the largest torque of a joint without a limit.

    """
    if len(torque) < _FEWEST_TICKS:
        return np.zeros(torque.shape[1])
    change = np.diff(torque, axis=0)
    is_large = np.abs(change) > np.maximum(_AMPLITUDE * scale, _ROUNDING)
    rising = [column[large] > 0.0 for column, large in zip(change.T, is_large.T, strict=True)]
    return np.array([np.count_nonzero(r[1:] != r[:-1]) for r in rising]) / len(change)


def chatter_notes(
    torque: Array, window: Array, parameters: Mapping[str, Values], joints: Sequence[Coordinate]
) -> tuple[str, ...]:
    """
    Return a sentence about the joints that chatter; none if no joint does.

    Parameters
    ----------
    torque
        Torques (n, joints) of the whole run in N·m or N.
    window
        Torques of the window that is judged.
    parameters
        Parameters by node; a log may lack those of the plant.
    joints
        Driven joints of the robot.

    """
    if not len(window):
        return ()
    limits = np.full(len(joints), np.inf)
    for node in ('controller', 'plant'):
        limit = np.array(parameters.get(node, {}).get('torque_limit', 0.0))
        limits = np.where(limit > 0.0, np.minimum(limit, limits), limits)
    scale = np.where(np.isfinite(limits), limits, np.abs(torque).max(axis=0))
    shares = reversal_shares(window, scale)
    names = [joint.name for joint, share in zip(joints, shares, strict=True) if share > _SHARE]
    if not names:
        return ()
    has_noise = np.any(parameters.get('plant', {}).get('velocity_noise', 0.0))
    return (
        f'the torque of {listed(names)} chatters: its change reverses at up to {shares.max():.0%}'
        f' of the ticks, by more than {_AMPLITUDE:.0%} of the limit, or of the largest torque'
        f' without a limit; {_NOISY if has_noise else _REMEDY}.',
    )


Window = tuple[float, float]

_EVENTS = 3
"""Maximum number of events in the notes: the last ones."""

_STATE_EVENTS = ACTIVATED, RESUMED, DEACTIVATED, GUIDED
"""Events that are changes of the controller's state."""


class ErrorSpan(NamedTuple):
    """Part of a window for which a run has errors: it may end early, start late or have gaps."""

    first: float | None
    last: float | None
    """Times in s of the first and the last error in the window; None without errors."""
    share: float
    """Part of the window, from 0 to 1."""


@dataclass(frozen=True)
class MetricSamples:
    """
    Signals of a run, from which its metrics follow; times in s from the first state.

    Attributes
    ----------
    times
        (K) of the errors.
    error
        (K, axes) in m or rad.
    torque_times
        (M) of the commands.
    torque
        (M, joints) in N·m.
    window
        start <= t < end.
    points
        points of the robot.
    estimate
        (L, parameters) base inertial parameters over time, or None.
    contact
        (N, wheels * CONTACT) contacts of the wheels over time, or None.
    changed
        time of the last change of parameters.

    """

    times: Array
    error: Array
    torque_times: Array
    torque: Array
    window: Window
    points: Sequence[Point]
    estimate: Array | None = None
    contact: Array | None = None
    changed: float = -math.inf

    @classmethod
    def of_ticks(
        cls,
        error: Array,
        torque: Array,
        period: float,
        points: Sequence[Point],
        *,
        active: Flags | slice = slice(None),
        estimate: Array | None = None,
    ) -> MetricSamples:
        """
        Return the samples of a computed run, with the second half as its window.

        Parameters
        ----------
        error
            (n, axes) of all ticks.
        torque
            (n, joints) in N·m; (0, joints) if velocities are commanded.
        period
            control period in s.
        points
            points of the robot.
        active
            (n) ticks whose errors count.
        estimate
            (L, parameters) base inertial parameters.

        """
        times = np.arange(len(error), dtype=np.float64) * period
        window = second_half(times)
        commands = times[: len(torque)]
        return cls(times[active], error[active], commands, torque, window, points, estimate)

    def errors(self, point: Point) -> Array:
        """Return the errors (n, m) of a point in the window."""
        return self.error[self._within(self.times), point.axes]

    def torques(self) -> Array:
        """Return the torques (n, joints) in the window."""
        return self.torque[self._within(self.torque_times)]

    def metrics(self) -> Metrics:
        """Compute the metrics."""
        return Metrics(
            *self.window,
            {point: Reached(**_computed(Reached, self, point)) for point in self.points},
            self.torque.shape[1],
            **_computed(Metrics, self),
            errors=self.error_span(),
        )

    def error_span(self) -> ErrorSpan:
        """Return the part of the window for which there are errors."""
        times = self.times[self._within(self.times)]
        if not len(times):
            return ErrorSpan(None, None, 0.0)
        start, end = self.window
        steps = np.diff(self.times)
        period = float(np.median(steps)) if len(steps) else 0.0
        # The last state of a run is not in its window; a late message is no gap.
        missing = np.diff(np.concatenate([[start], times, [end]])) - period
        lost = float(missing[missing > period].sum())
        return ErrorSpan(float(times[0]), float(times[-1]), 1.0 - lost / max(end - start, period))

    def _within(self, times: Array) -> Flags:
        start, end = self.window
        return (start <= times) & (times < end)


class RunSums(NamedTuple):
    """
    Sums of a run over the ticks of its window, in place of samples that are not kept.

    Attributes
    ----------
    ticks
        number of ticks in the window.
    duration
        length of the window in s.
    square_sum, largest_square
        (points) sum and largest one of the squared distances in m² or rad².
    settled
        (points) settling time in s, infinity without one.
    torque_square_sum
        sum of the squared norms of the torques in N²·m²; None if velocities are commanded.
    torque_change_sum
        sum of all changes of the torques in N·m, or None.
    estimate
        (parameters) last estimate of the base inertial parameters, or None.

    """

    ticks: int
    duration: float
    square_sum: Array
    largest_square: Array
    settled: Sequence[float]
    torque_square_sum: float | None
    torque_change_sum: float | None
    estimate: Array | None

    def metrics(self, points: Sequence[Point], window: Window, joints: int) -> Metrics:
        """Compute the metrics; those without a formula of sums are None."""
        return Metrics(
            *window,
            {p: Reached(**_summed(Reached, self, i)) for i, p in enumerate(points)},
            joints,
            **_summed(Metrics, self),
        )


class Metric(NamedTuple):
    """
    Declaration of a metric, for all tables, files and pages, and for campaigns.

    Attributes
    ----------
    name
        name in files with numbers.
    head
        head of its column.
    unit
        SI unit; empty: unit of the point.
    formula
        value of samples, and of a point if it is one of a point; None or NaN without data.
    of_sums
        the same value of the `RunSums` of a run, and of the index of a point if it is one of a
        point. Campaigns keep no samples; None: they do not compute the metric, and say so.
    is_small
        whether tables show thousandths of the unit.
    of_contact
        whether only runs with wheels in contact have it.
    is_compared
        whether `masmc compare` shows it.
    is_shown
        whether tables for people show it; files with numbers contain every metric.
    is_larger_better
        whether a larger value is better.

    """

    name: str
    head: str
    unit: str
    formula: Callable[..., float | None]
    of_sums: Callable[..., float | None] | None = None
    is_small: bool = False
    of_contact: bool = False
    is_compared: bool = False
    is_shown: bool = True
    is_larger_better: bool = False


def _metric(*declaration: Any, **options: Any) -> Any:
    """Return the field of a metric."""
    return field(default=None, metadata={'metric': Metric(*declaration, **options)})


@cache
def declared(kind: type) -> Mapping[str, Metric]:
    """Return the metrics of a class by attribute, in the order of columns."""
    return {f.name: f.metadata['metric'] for f in fields(kind) if 'metric' in f.metadata}


def _computed(kind: type, *arguments: Any) -> dict[str, Any]:
    return {name: metric.formula(*arguments) for name, metric in declared(kind).items()}


def _summed(kind: type, *arguments: Any) -> dict[str, Any]:
    return {
        name: metric.of_sums(*arguments)
        for name, metric in declared(kind).items()
        if metric.of_sums is not None
    }


def _sums(values: Array) -> Array:
    """Return the sums (n) of the rows of (n, m) values, added in their order."""
    totals: Array = np.add.accumulate(values, axis=1)[:, -1]
    return totals


def _total(values: Array) -> float:
    """
    Return the sum of (n) values, n > 0, added in their order.

    `np.sum` adds in an order that depends on n. Runs whose signals are not kept add tick by tick,
    and their metrics are bitwise identical.
    """
    return float(np.add.accumulate(values)[-1])


def rms_norm(vectors: Array) -> float | None:
    """Return the root mean square of the Euclidean norms of (n, m) vectors; None for n = 0."""
    return math.sqrt(_total(_sums(vectors**2)) / len(vectors)) if len(vectors) else None


def largest_norm(vectors: Array) -> float | None:
    """Return the largest Euclidean norm of (n, m) vectors; None for n = 0."""
    return float(np.sqrt(np.max(_sums(vectors**2)))) if len(vectors) else None


def total_variation(samples: Array) -> float:
    """Return the total variation of (n, m) samples, summed over the m columns."""
    return _total(_sums(np.abs(np.diff(samples, axis=0)))) if len(samples) > 1 else 0.0


def _variation(samples: MetricSamples) -> float | None:
    """Return sum_i sum_k |tau_i,k+1 - tau_i,k| / (end - start) of the commands."""
    torques, (start, end) = samples.torques(), samples.window
    return total_variation(torques) / (end - start) if len(torques) else None


def _estimate_norm(samples: MetricSamples) -> float | None:
    """Return the Euclidean norm of the last estimate, whose units are mixed (kg, kg·m², kg·m)."""
    estimate = samples.estimate
    return _norm(estimate[-1]) if estimate is not None and len(estimate) else None


def _norm(vector: Array | None) -> float | None:
    return None if vector is None else float(np.linalg.norm(vector))


def _rms(square_sum: float | None, ticks: int) -> float | None:
    """Return the root of the mean of squares with a known sum; None without ticks."""
    return math.sqrt(square_sum / ticks) if ticks and square_sum is not None else None


def _per_second(change: float | None, ticks: int, duration: float) -> float | None:
    return change / duration if ticks and change is not None else None


@dataclass(frozen=True)
class Reached:
    """
    Distances of a point from its reference; a value is None if the log lacks its data.

    The settling time is that over the whole run, see `settling_time`; infinity if the distance
    does not stay small.
    """

    rms: float | None = _metric(
        'rms', 'RMS', '', lambda run, point: rms_norm(run.errors(point)),
        lambda sums, i: _rms(float(sums.square_sum[i]), sums.ticks),
    )
    largest: float | None = _metric(
        'max', 'max', '', lambda run, point: largest_norm(run.errors(point)),
        lambda sums, i: math.sqrt(float(sums.largest_square[i])) if sums.ticks else None,
    )
    settling: float | None = _metric(
        'settling', 'settles', 's',
        lambda run, point: settling_time(run.times, run.error[:, point.axes], run.changed),
        lambda sums, i: sums.settled[i],
    )


@dataclass(frozen=True)
class Metrics:
    """
    Errors and torques of a run over the window start <= t < end in s from the first state.

    A value is None if the log lacks its data. `points` contains the distances of the robot's
    points, `joints` is the number of commanded torques, `errors` the part of the window with
    errors, None if they cover all of it by construction. `notes` are sentences about the log:
    messages that are not used, events, clocks that differ.
    """

    start: float
    end: float
    points: Mapping[Point, Reached]
    joints: int
    torque_rms: float | None = _metric(
        'torque_rms', 'torque RMS', 'N·m', lambda run: rms_norm(run.torques()),
        lambda sums: _rms(sums.torque_square_sum, sums.ticks),
        is_compared=True,
    )
    torque_variation: float | None = _metric(
        'torque_variation', 'torque variation', 'N·m/s', _variation,
        lambda sums: _per_second(sums.torque_change_sum, sums.ticks, sums.duration),
        is_compared=True,
    )
    estimate_norm: float | None = _metric(
        'estimate_norm', 'estimate norm', 'mixed', _estimate_norm,
        lambda sums: _norm(sums.estimate),
        # Its units are mixed. Programs that read the files expect the column.
        is_shown=False,
    )
    fastest_slip: float | None = _metric(
        'fastest_slip', 'fastest slip', 'm/s',
        lambda run: None if run.contact is None else largest_slip(run.contact),
        is_small=True, of_contact=True,
    )
    least_normal_force: float | None = _metric(
        'least_normal_force', 'least normal force', 'N',
        lambda run: None if run.contact is None else least_normal_force(run.contact),
        of_contact=True, is_larger_better=True,
    )

    errors: ErrorSpan | None = field(default=None, compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)

    def of(self, key: str) -> Reached:
        """Return the distances of a point, by its key."""
        return next(reached for point, reached in self.points.items() if point.key == key)


def metrics(run: Run, *, window: Window | None = None, tracked: Tracking | None = None) -> Metrics:
    """
    Compute the metrics of a logged run.

    Parameters
    ----------
    run
        the run.
    window
        start <= t < end in s from the first state; by default the second half.
    tracked
        the run's tracking, if it is known already.

    """
    tracked = tracking(run) if tracked is None else tracked
    start = run.times[0]
    estimate = run.telemetry.get('estimate')
    changes = run_changes(run)
    samples = MetricSamples(
        tracked.times,
        tracked.error,
        run.torque.times - start,
        run.torque.values,
        window or second_half(run.times - start),
        run.mechanism.points,
        None if estimate is None else estimate.values,
        None if run.contact is None else run.contact.values,
        max((change.time for change in changes), default=-math.inf),
    )
    reached = samples.metrics()
    chatter = chatter_notes(
        run.torque.values, samples.torques(), run.parameters, run.mechanism.joints
    )
    return replace(reached, notes=(*run.notes, *_events(run, changes), *chatter))


def _events(run: Run, changes: Sequence[ParameterChange]) -> list[str]:
    """Return sentences about restarts, times without the law and their reasons, and resets."""
    start, states = float(run.times[0]), run.controller_states
    restarts = [
        f'{as_line(node)} was restarted while the robot ran: its state was lost there.'
        for node in run.restarted
    ]
    events = [
        (change.time, f'Event {as_line(change.name)} at t = {change.time:.3f} s.')
        for change in changes
        # The states of the controller have the reasons as well.
        if change.is_event and not (states and change.name in _STATE_EVENTS)
    ]
    ends = [*(time - start for time, _ in states[1:]), math.inf]
    for (time, text), end in zip(states, ends, strict=False):
        if text != Mode.ACTIVE.value and end > 0.0:
            until = 'the end' if end == math.inf else f'{end:.3f} s'
            first = max(time - start, 0.0)
            events.append((
                first, f'Controller {as_line(text)}, from t = {first:.3f} s to {until}.'
            ))
    events.sort()
    earlier = len(events) - _EVENTS
    if earlier > 0:
        count = f'{earlier} earlier event{"s" if earlier > 1 else ""} of the controller'
        events = [(0.0, f'{count} before these:'), *events[-_EVENTS:]]
    return [*restarts, *(text for _, text in events)]


def second_half(times: Array) -> Window:
    """Return the second half of the time (n) from 0 to the last of `times`, s."""
    end = float(times[-1])
    return end / 2, end
