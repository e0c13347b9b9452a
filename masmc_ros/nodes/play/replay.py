# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Replay of a logged run on the page, without ROS."""

from __future__ import annotations

from collections.abc import Callable
import queue
import time

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.nodes.play.page import (
    change_text,
    CHANGES,
    MOST_POINTS,
    Page,
    RATE,
    show_value,
    SLOW,
    text_block,
)
from masmc_ros.nodes.play.plots import estimate_reference, shown_robot, TRUE_VALUE
from masmc_ros.nodes.play.samples import WINDOW
from masmc_ros.nodes.play.scene import path_of, places_of
from masmc_ros.params.presentation import gain_text
from masmc_ros.report.measure.adaptation import true_theta_of_run
from masmc_ros.report.measure.parameters import ParameterChange, run_changes
import numpy as np
from viser import GuiEvent, GuiSliderHandle

_FASTEST = 10.0
"""Largest speed relative to real time."""


class Replay:
    """A logged run on a page: play, pause, speed and time."""

    def __init__(self, run: Run, page: Page, warn: Callable[[str], object]) -> None:
        """
        Show the start of a run.

        Parameters
        ----------
        run
            Logged run.
        page
            Page without content.
        warn
            Function that prints a line about meshes that are not shown.

        Raises
        ------
        InputError
            If the log has no run, or does not describe its robot.

        """
        shown = shown_robot(run.parameters)
        if shown is None or len(run.times) < 2:
            raise InputError(
                f'{run.path}: no robot or no motion in it; expected states, and plant/parameters'
                ' or controller/parameters, as the nodes of this package publish them'
            )
        self._run, self._page, self._robot = run, page, shown.robot
        self._scene = page.add_scene(shown, warn)
        reference = estimate_reference(run.parameters, shown.robot)
        true = true_theta_of_run(run)
        if reference is not None and reference.meaning == TRUE_VALUE and true is not None:
            # With all payloads of the run. Their times are those from its first state.
            reference = reference._replace(theta=lambda times: true.at(times - run.times[0]))
        self._plots = None if reference is None else page.add_plots(reference)
        self._start, self._end = float(run.times[0]), float(run.times[-1])
        self._changes = run_changes(run)
        self._show_paths()
        gui = page.server.gui
        self._notice = gui.add_html('', order=0.0)
        self._playing = gui.add_checkbox('Play', initial_value=True, order=1.0)
        self._speed = gui.add_slider('Speed', 0.1, _FASTEST, 0.1, 1.0, order=2.0)
        length = self._end - self._start
        self._slider = gui.add_slider('Time (s)', 0.0, length, length / 1000.0, 0.0, order=3.0)
        self._sought: queue.SimpleQueue[float] = queue.SimpleQueue()

        def on_time(event: GuiEvent[GuiSliderHandle[float]]) -> None:
            # A change without a viewer is that of `update`.
            if event.client is not None:
                self._sought.put(event.target.value)

        self._slider.on_update(on_time)
        self._time = self._start
        self._updates = 0
        self._seek(0.0)

    def play(self) -> None:
        """Play until interrupted."""
        last = time.monotonic()
        while True:
            time.sleep(1.0 / RATE)
            now = time.monotonic()
            self.update(now - last)
            last = now

    def update(self, elapsed: float) -> None:
        """Show the run after `elapsed` seconds of real time."""
        sought = None
        while not self._sought.empty():
            sought = self._sought.get()
        if sought is not None:
            self._seek(sought)
        elif self._playing.value and self._page.is_viewed:
            self._time = min(self._time + elapsed * self._speed.value, self._end)
            self._add_samples(self._time)
        self._scene.is_followed = self._page.is_followed
        with self._page.server.atomic():
            self._scene.move(self._run.position[self._index(self._run.times, self._time)])
            self._updates += 1
            if self._updates % SLOW == 0:
                self._show_texts()

    def _seek(self, offset: float) -> None:
        """Continue at a time in s from the start, with the plots of the window before it."""
        self._time = min(self._start + offset, self._end)
        first = max(self._start, self._time - WINDOW)
        for instant in np.arange(first, self._time, 1.0 / RATE):
            self._add_samples(float(instant))
        self._add_samples(self._time)

    def _add_samples(self, instant: float) -> None:
        """Add the latest signals at a time in s to the plots."""
        if self._plots is None:
            return
        run = self._run
        index = self._index(run.times, instant)
        self._plots.add_torque(float(run.times[index]), run.applied_effort[index])
        for name, add in (
            ('error', self._plots.add_error), ('estimate', self._plots.add_estimate)
        ):  # fmt: skip
            series = run.telemetry.get(name)
            if series is not None and len(series) and series.times[0] <= instant:
                index = self._index(series.times, instant)
                add(float(series.times[index]), series.values[index])

    def _show_texts(self) -> None:
        """Show plots, time, state of the controller, and the last changes until this time."""
        offset = self._time - self._start
        if self._plots is not None:
            marks = [self._start + c.time for c in self._changes if not c.is_event]
            self._plots.send(marks)
        show_value(self._slider, offset)
        states = [s for instant, s in self._run.controller_states if instant <= self._time]
        lines = [f't = {offset:.2f} s of {self._end - self._start:.2f} s']
        lines += [f'controller: {states[-1]}'] if states else []
        past = [_line(change) for change in self._changes if change.time <= offset]
        self._notice.content = text_block(lines) + text_block(past[-CHANGES:])

    def _show_paths(self) -> None:
        """Show the actual path, and the desired one if the log has a reference."""
        run = self._run
        step = max(1, len(run.times) // MOST_POINTS)
        self._scene.show_actual(path_of(self._robot, run.position[::step]))
        if run.reference is not None:
            axes = len(run.mechanism.axes)
            desired = places_of(self._robot, run.reference[::step, :axes])
            self._scene.show_desired(desired[np.isfinite(desired).all(axis=1)])

    @staticmethod
    def _index(times: Array, instant: float) -> int:
        """Return the index of the last of times (n) in s up to an instant, at least 0."""
        return max(0, int(np.searchsorted(times, instant, 'right')) - 1)


def _line(change: ParameterChange) -> str:
    value = '' if change.is_event else f' = {gain_text(change.new)}'
    return change_text(change.time, f'{change.name}{value}')
