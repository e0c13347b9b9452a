# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Controls of the page: those of the controller, and payload and disturbance of a simulated plant.

viser calls functions of its viewers on separate threads. They queue the requests; the node's
thread sends them, and alone changes the page.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
import math
import queue
import time

from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH, PUSH_DURATION, TORQUE_LIMIT
from masmc_ros.nodes.play.page import PlayServer, show_value, text_block
from masmc_ros.params import presentation
from masmc_ros.params.declaration import MutableValues, Parameter, Values
from masmc_ros.robot.declaration import Mechanism
from viser import ClientHandle, GuiButtonHandle, GuiDropdownHandle, GuiEvent, GuiSliderHandle

MENUS = ('law', 'switching')
"""Parameters of the controller with a menu."""

SERVICES = {
    'enable': 'Enable',
    'disable': 'Disable',
    'reset_adaptation': 'Reset adaptation',
    'reset_robot': 'Reset robot',
}
"""Requests of buttons, with their labels."""

_GRACE = 0.5
"""Time in s from the last move of a control until it follows the node again."""

_QUESTION = (
    'This page did not start the robot. Its sliders and buttons change the gains of the running '
    'controller, enable and disable it, and act on a simulated plant.\n\nAfter *Allow commands*, '
    'move the control again.'
)

_SAVED_NAME = 'masmc.yaml'


class Controls:
    """
    Controls of a controller's parameters, and its values as text.

    Attributes
    ----------
    values
        Parameter values by names such as `/controller.k_s1`; replaced, never modified.
    may_command
        False for a page that only shows.

    """

    def __init__(
        self,
        server: PlayServer,
        node: str,
        *,
        may_command: bool,
        asks_first: bool,
        saved: Callable[[], str | None],
    ) -> None:
        """
        Initialise empty controls.

        Parameters
        ----------
        server
            Server of the page.
        node
            Full name of the controller.
        may_command
            False for a page that only shows.
        asks_first
            True for robots that this page must not command before a viewer allows it, once.
        saved
            Function that returns the current parameter file, None before there is one.

        """
        self.values: Values = {}
        self._server, self._gui, self._node = server, server.gui, node
        self.may_command, self._saved = may_command, saved
        self._is_allowed = not asks_first
        self._asked: set[int] = set()
        self._errors: dict[str, str] = {}
        self._parameters: Mapping[str, Parameter] = {}
        self._show: dict[str, Callable[[object], None]] = {}
        self._shown: dict[str, object] = {}
        self._moved: dict[str, float] = {}
        self._changes: queue.SimpleQueue[tuple[str, object]] = queue.SimpleQueue()
        self._services: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._notices: tuple[str, ...] = ()
        self._notice = self._gui.add_html('', order=0.0)
        self._folder = self._gui.add_folder('Controller', order=1.0, visible=False)
        self._table = self._gui.add_html('', order=2.0)
        self._history_lines: tuple[str, ...] = ()
        self._history = self._gui.add_html('', order=3.0)
        hint = 'Parameters of the run as a file for masmc simulate and for the nodes'
        save = self._gui.add_button('Save as YAML', hint=hint, order=4.0)
        save.on_click(self._on_save)

    def build(self, parameters: Mapping[str, Parameter], values: Values) -> None:
        """
        Add the controls for a controller in place of previous ones.

        Parameters
        ----------
        parameters
            Declarations of the controller by name.
        values
            Its checked values by name.

        """
        self._folder.remove()
        self._parameters = parameters
        self._show.clear()
        self._folder = self._gui.add_folder('Controller', order=1.0, visible=self.may_command)
        if not self.may_command:
            return
        with self._folder:
            for name in presentation.SLIDERS:
                if name in values:
                    self._add_slider(parameters[name], values[name])
            for name in MENUS:
                if name in values:
                    self._add_menu(parameters[name], values[name])
            for service, label in SERVICES.items():
                self._add_button(service, label)

    def _add_slider(self, parameter: Parameter, value: object) -> None:
        name = parameter.name
        bounds = presentation.slider_range(parameter, presentation.level_of(value))
        handle = self._gui.add_slider(
            name,
            *bounds,
            min(max(presentation.level_of(value), bounds.lowest), bounds.highest),
            hint=f'{parameter.description} [{parameter.unit}]',
        )

        def show(shown: object) -> None:
            nonlocal bounds
            level = presentation.level_of(shown)
            if not math.isfinite(level):
                return
            self._shown[name] = shown
            if not bounds.contains(level):
                bounds = _widened(handle, presentation.slider_range(parameter, level), level)
            show_value(handle, level)

        self._show[name], self._shown[name] = show, value
        handle.on_update(lambda event: self._on_move(event, name))

    def _add_menu(self, parameter: Parameter, value: object) -> None:
        options = parameter.known_choices()
        handle = self._gui.add_dropdown(
            parameter.name, options, initial_value=str(value), hint=parameter.description
        )

        def show(shown: object) -> None:
            show_value(handle, str(shown))

        self._show[parameter.name] = show
        handle.on_update(lambda event: self._on_move(event, parameter.name))

    def _add_button(self, service: str, label: str) -> None:
        button = self._gui.add_button(label)

        def click(event: GuiEvent[GuiButtonHandle]) -> None:
            if self._may_send(event.client_id):
                self._services.put(service)

        button.on_click(click)

    def _on_move(
        self, event: GuiEvent[GuiSliderHandle[float]] | GuiEvent[GuiDropdownHandle[str]], name: str
    ) -> None:
        """Queue a change by a viewer; a change by the node has no viewer."""
        if event.client is None:
            return
        level = event.target.value
        value: object = level
        if not isinstance(level, str):
            value = presentation.scaled(self._shown[name], level)
        self.request(event.client_id, f'{self._node}.{name}', value)

    def request(self, client: int | None, name: str, value: object) -> None:
        """
        Queue a change that a viewer requests.

        Parameters
        ----------
        client
            Number of the viewer's connection.
        name
            Name such as `/controller.k_s1`.
        value
            Requested value.

        """
        self._moved[name] = time.monotonic()
        if self._may_send(client):
            self._changes.put((name, value))

    def _may_send(self, client: int | None) -> bool:
        """Return True if a viewer may command the robot; ask the first one if necessary."""
        if not self._server.is_own_page(client):
            return False
        viewer = None if client is None else self._server.get_clients().get(client)
        if not self._is_allowed and viewer is not None:
            self._ask(viewer)
        return self._is_allowed

    def _ask(self, viewer: ClientHandle) -> None:
        """Ask a viewer whether this page may command the robot; the command is not sent."""
        if viewer.client_id in self._asked:
            # A drag of a slider sends many commands.
            return
        self._asked.add(viewer.client_id)
        modal = viewer.gui.add_modal('Command this robot?')
        with modal:
            viewer.gui.add_markdown(_QUESTION)
            allow = viewer.gui.add_button('Allow commands')
            cancel = viewer.gui.add_button('Cancel')

        def on_answer(event: GuiEvent[GuiButtonHandle]) -> None:
            self._is_allowed |= event.target is allow
            self._asked.discard(viewer.client_id)
            modal.close()

        allow.on_click(on_answer)
        cancel.on_click(on_answer)

    def _on_save(self, event: GuiEvent[GuiButtonHandle]) -> None:
        text = self._saved()
        if isinstance(event.client, ClientHandle) and text is not None:
            event.client.send_file_download(_SAVED_NAME, text.encode(), save_immediately=True)

    def changes(self) -> MutableValues:
        """Return the requested values by name since the last call, of each name the last one."""
        changes: MutableValues = {}
        while not self._changes.empty():
            name, value = self._changes.get()
            changes[name] = value
        return changes

    def services(self) -> list[str]:
        """Return the requests of buttons since the last call."""
        services = []
        while not self._services.empty():
            services.append(self._services.get())
        return services

    def show_values(self, values: Values) -> None:
        """Store current values by name, which `refresh` shows."""
        self.values = {**self.values, **values}

    def show_error(self, name: str, reason: str) -> None:
        """Show the reason why a request failed, until `clear_error`."""
        self._errors[name] = reason
        self._show_notices()

    def clear_error(self, name: str) -> None:
        """Remove the error of a request."""
        if self._errors.pop(name, None) is not None:
            self._show_notices()

    def show_notices(self, lines: tuple[str, ...]) -> None:
        """Show lines about the run above the controls."""
        if lines != self._notices:
            self._notices = lines
            self._show_notices()

    def show_history(self, lines: tuple[str, ...]) -> None:
        """Show the last changes, a line each."""
        if lines != self._history_lines:
            self._history_lines = lines
            self._history.content = text_block(('Changes', *lines))

    def refresh(self) -> None:
        """Show the values of the controller, except in controls that a viewer is moving."""
        lines = []
        for name in (*presentation.SLIDERS, *MENUS):
            value = self.values.get(f'{self._node}.{name}')
            if value is None:
                continue
            lines.append(f'{name}: {presentation.gain_text(value)}')
            if name in self._show and self.is_still(f'{self._node}.{name}'):
                # Another node of this name may send any value.
                with suppress(InputError):
                    self._show[name](self._parameters[name].check(value))
        if lines and (content := text_block(lines)) != self._table.content:
            self._table.content = content

    def is_still(self, name: str) -> bool:
        """Return True if no viewer has just moved the control of a parameter."""
        return time.monotonic() - self._moved.get(name, -_GRACE) >= _GRACE

    def _show_notices(self) -> None:
        errors = [f'{name}: {reason}' for name, reason in self._errors.items()]
        self._notice.content = text_block(self._notices) + text_block(errors, 'color:#c0392b')


def _widened(
    handle: GuiSliderHandle[float], bounds: presentation.SliderRange, level: float
) -> presentation.SliderRange:
    """Give a slider the range for a value outside of its own; return the range."""
    bounds = bounds._replace(lowest=min(bounds.lowest, level), highest=max(bounds.highest, level))
    handle.min, handle.max, handle.step = bounds
    return bounds


_HEAVIEST = 5.0
"""End of the slider of the payload in kg, unless the run has a heavier one."""

_STRONGEST = 20.0
"""End of the slider of the push in N·m or N for a robot without limits of torques."""

_STEPS = 100


class PlantControls:
    """Slider of the payload; joint, torque and button of a push."""

    def __init__(self, server: PlayServer, node: str, controls: Controls) -> None:
        """
        Initialise without controls.

        Parameters
        ----------
        server
            Server of the page.
        node
            Full name of the plant.
        controls
            Controls of the controller, which queue the requests of viewers.

        """
        self._gui, self._node, self._controls = server.gui, node, controls
        self._folder = self._gui.add_folder('Robot', order=1.5, visible=False)
        self._payload: GuiSliderHandle[float] | None = None
        self._mass: Parameter | None = None

    def build(self, mechanism: Mechanism, declared: Parameter, values: Values) -> None:
        """
        Add the controls of a plant in place of previous ones.

        Parameters
        ----------
        mechanism
            Type of the robot.
        declared
            Declaration of the mass of the payload.
        values
            Checked values of the plant by name.

        """
        self._folder.remove()
        is_shown = self._controls.may_command
        self._folder = self._gui.add_folder('Robot', order=1.5, visible=is_shown)
        self._mass = declared
        if not is_shown:
            return
        units = ', '.join(dict.fromkeys(joint.effort_unit for joint in mechanism.joints))
        joints = [joint.short for joint in mechanism.joints]
        heaviest = max(_HEAVIEST, 2.0 * PAYLOAD_MASS.of(values))
        strongest = max(TORQUE_LIMIT.of(values)) or _STRONGEST
        with self._folder:
            payload = self._gui.add_slider(
                'Payload (kg)', 0.0, heaviest, heaviest / _STEPS, PAYLOAD_MASS.of(values)
            )
            joint = self._gui.add_dropdown('Pushed joint', joints, initial_value=joints[-1])
            torque = self._gui.add_slider(
                f'Push ({units})', -strongest, strongest, strongest / _STEPS, 0.5 * strongest
            )
            hint = f'Disturbance torque on this joint for {PUSH_DURATION.of(values):g} s'
            button = self._gui.add_button('Push', hint=hint)

        def on_payload(event: GuiEvent[GuiSliderHandle[float]]) -> None:
            if event.client is not None:
                name = f'{self._node}.{PAYLOAD_MASS.name}'
                self._controls.request(event.client_id, name, float(event.target.value))

        def on_push(event: GuiEvent[GuiButtonHandle]) -> None:
            push = [torque.value if name == joint.value else 0.0 for name in joints]
            self._controls.request(event.client_id, f'{self._node}.{PUSH.name}', push)

        payload.on_update(on_payload)
        button.on_click(on_push)
        self._payload = payload

    def refresh(self) -> None:
        """Show the payload of the plant, unless a viewer is moving its slider."""
        name = f'{self._node}.{PAYLOAD_MASS.name}'
        value = self._controls.values.get(name)
        if self._payload is None or self._mass is None or not self._controls.is_still(name):
            return
        # Another node of this name may send any value.
        with suppress(InputError):
            mass = presentation.level_of(self._mass.check(value))
            self._payload.max = max(self._payload.max, mass)
            show_value(self._payload, mass)
