# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Controls of a simulated plant on the page: its payload, and a push."""

from __future__ import annotations

from contextlib import suppress

from masmc_ros.errors import InputError
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH, PUSH_DURATION, TORQUE_LIMIT
from masmc_ros.nodes.play.controls import Controls
from masmc_ros.nodes.play.page import show_value
from masmc_ros.nodes.play.server import PlayServer
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.sliders import level_of
from masmc_ros.robot.declaration import Mechanism
from viser import GuiButtonHandle, GuiEvent, GuiSliderHandle

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
            mass = level_of(self._mass.check(value))
            self._payload.max = max(self._payload.max, mass)
            show_value(self._payload, mass)
