# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
State machine of the controller, without ROS.

Each event returns the actions that follow from it, in order. There are no callbacks and no
waiting, and the caller supplies the time. Stamps are in ns, `now` is a steady time in s.
"""

from __future__ import annotations

from collections.abc import Callable
import math

from masmc_ros.aliases import Array
from masmc_ros.control.actions import Actions, Failure, Halt, HaltCommand, Line, NOTHING, Repeat
from masmc_ros.control.gates import Pacing, PACINGS, ReferenceGate, StateGate
from masmc_ros.control.layer_watch import LayerWatch
from masmc_ros.control.outbox import Outbox
from masmc_ros.control.supervisor import (
    Cause,
    find_transition,
    LifecycleState,
    state_of,
    Supervisor,
)
from masmc_ros.errors import UserError
from masmc_ros.loop import controller_events
from masmc_ros.loop.closed_loop import NOT_FINITE, SINGULAR
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import ACTIVE_ON_START, RUNAWAY_DETECTION
from masmc_ros.loop.drive import Drive, Source
from masmc_ros.loop.runaway import RunawayWatch
from masmc_ros.loop.safe_stop import BALANCE_TIME
from masmc_ros.loop.simulated_robot import diverged
from masmc_ros.loop.timing import PACING, Timing
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.stamps import Order
from masmc_ros.params.declaration import Values
from masmc_ros.reference.approach import Approach


class ControllerCore:
    """
    Responds to each received robot state with exactly one command.

    The command is computed by the law, or by the safe stop (`fault_action`) while the law is not
    active, or it is void. A state without a reference is pending until the reference arrives. The
    law restarts after an activation, after missing states and after time was set back. The core
    decides the events of the run; it applies each to the drive, and records it.

    Attributes
    ----------
    controller
        Law and its results.
    drive
        Law, approach and safe stop.
    supervisor
        Mode: active, inactive or fault.
    states
        Received states.
    reference
        Received reference.
    pacing
        Lock-step or real time.
    missing_source
        Function that returns the source without which states are not complete.

    """

    def __init__(
        self,
        controller: Controller,
        approach: Approach,
        layer: LayerWatch,
        timing: Timing,
        values: Values,
    ) -> None:
        """
        Initialise the core.

        Parameters
        ----------
        controller, approach, layer
            Parts that compute; they belong to the core from now on.
        timing
            Control period and number of ticks of the run.
        values
            All checked parameter values of the controller.

        """
        self.controller = controller
        self.supervisor = Supervisor(active=ACTIVE_ON_START.of(values))
        self._outbox = outbox = Outbox(timing, values)
        self.states = StateGate(len(controller.mechanism.positions))
        self.reference = ReferenceGate(
            controller.robot, lambda text: outbox.add_line('warning', text)
        )
        self.missing_source: Callable[[], str] = lambda: 'joint_states'
        self._layer = layer
        pacing = PACINGS[PACING.of(values)]
        self.drive = Drive(
            controller,
            approach,
            is_active=self.supervisor.is_active,
            is_timed=pacing.is_timed,
        )
        self._watch = RunawayWatch(controller, controller.mechanism.speed_limits)
        self._values = dict(values)
        self._error: UserError | None = None
        self._was_singular = False
        self._awaited = ''
        self._halted: int | None = None
        self._set_pacing(pacing)

    # Events.

    def start(self) -> Actions:
        """Publish the state of the controller for the first time."""
        return self._after_change(0.0)

    def on_state(self, stamp: int, position: Array, velocity: Array, now: float) -> Actions:
        """
        Respond to a state.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        position, velocity
            State (positions) in the order of joint_states; the caller may overwrite both later.
        now
            Time of arrival in s.

        """
        states, is_timed, is_alive = self.states, self.pacing.is_timed, True
        order = states.judge(stamp)
        if order is Order.LATE:
            return NOTHING
        if order is Order.REPEATED:
            is_alive = states.is_alive_when_repeated(is_timed=is_timed)
            if states.pending is None and not (is_alive and self._lacks_states()):
                states.counts.repeated += 1
                if is_alive:
                    states.note_arrival(now)
                return (Repeat(),)
            order = Order.NEXT if states.pending is None else states.pending_order
        elif order is not Order.NEXT:
            self._restart(order, now)
        if is_alive:
            states.note_arrival(now)
            states.void_due = math.inf
        states.pending_order = order
        if is_timed:
            states.keep(position, velocity)
        if is_alive and not self.supervisor.is_active and self._watch.may_continue(now):
            self._recover_states()
        return self._respond(stamp, position, velocity, now)

    def on_mixed_states(self, senders: str, now: float) -> Actions | None:
        """
        End the law because states come from two robots; return None in lock-step.

        Their torques would belong to no robot. The caller drops the states while they are mixed.
        The next usable state ends the fault, as after missing states.
        """
        if not self.pacing.is_timed:
            return None
        was_active = self.supervisor.is_active
        if not was_active and (self.drive.is_stale or not self.drive.stop.commands):
            return NOTHING
        if was_active:
            self.supervisor.fail(Cause.STATES, f'states of two robots: {senders}')
            self._outbox.add_state(self.supervisor)
        self.states.drop_mixed()
        return self._lose_states(now)

    def on_jump(self, now: float) -> Actions:
        """Approach the reference from the pose to which a localisation moves the robot."""
        if not (self.pacing.is_timed and self.supervisor.is_active):
            return NOTHING
        self.drive.approach.start()
        self.controller.skip(0)
        if self._outbox.throttle.is_due('jump', now):
            return (Line('info', 'the pose jumped; the controller approaches its reference'),)
        return NOTHING

    def on_reference(self, window: ReferenceWindow, now: float) -> Actions:
        """
        Add a window of samples or a set-point.

        Raises
        ------
        InputError
            If it is not finite, has a wrong size or is out of reach, or if it is a set-point
            while a trajectory runs.

        """
        self.reference.add(window, self.states.order.last)
        return self._respond_to_pending(now)

    def on_timer(self, now: float) -> Actions:
        """Check for missing states; to be called at `deadline`."""
        if now < self.deadline:
            return NOTHING
        states = self.states
        if states.void_due <= now:
            states.void_due = math.inf
            self.drive.stop.release()
            assert states.order.last is not None
            # The state timeout of a law that was enabled meanwhile may be due as well.
            return (Halt(states.order.last), *self.on_timer(now))
        if not states.confirms_missing(now):
            return NOTHING
        if self.supervisor.is_active:
            source = self.missing_source()
            self.supervisor.fail(Cause.STATES, f'no usable {source} for {states.timeout:g} s')
            self._outbox.add_state(self.supervisor)
        return self._lose_states(now)

    @property
    def deadline(self) -> float:
        """Time in s at which to call `on_timer`; infinite for never."""
        stops = self.drive.stop.commands and not self.drive.is_stale
        return self.states.deadline(is_watched=self.supervisor.is_active or stops)

    def on_parameters(self, changed: Values) -> Actions:
        """Use checked values from the next tick on, as the controller does; record them."""
        self._values.update(changed)
        self._outbox.add_record(self._values, changed=tuple(changed))
        self.drive.stop.change()
        self._set_pacing(self.pacing)
        self._layer.restart()
        self._watch.restart()
        return NOTHING

    def on_code(self, awaited: str, now: float) -> Actions:
        """
        Wait for the compiled code of a law, or continue.

        Parameters
        ----------
        awaited
            The code that the next tick needs; empty for none. In lock-step the state is pending
            until it is ready, so that a change is in effect from the next tick on.
        now
            Time in s.

        """
        was_awaited, self._awaited = self._awaited, awaited
        if was_awaited and not awaited:
            return self._respond_to_pending(now)
        return NOTHING

    def on_plant(self, pacing: str) -> Actions:
        """
        Adapt to a simulated plant, which may pause and then repeats its state.

        Parameters
        ----------
        pacing
            Pacing of the plant. Real time is adopted; lock-step is not, because a message must
            not disable the timeouts.

        """
        self.states.has_plant = True
        if pacing != 'realtime' or self.pacing.is_timed:
            return NOTHING
        self.reference.restart_timeout()
        self._awaited = ''
        self._set_pacing(PACINGS[pacing])
        if self.states.pending is None:
            signals = self.controller.signals[0]
            self.states.keep(signals['position'][:, 0], signals['velocity'][:, 0])
        # A law or a safe stop that ended after the last state in lock-step must not continue.
        drive = self.drive
        is_void = drive.is_void(is_guided=self.supervisor.is_guided)
        has_ended = drive.source is Source.LAW or (drive.stop.commands and is_void)
        if self.states.order.last is not None and has_ended and not self.supervisor.is_active:
            self._halt()
        return self._outbox.take()

    def on_enable(self, now: float, *, enabled: bool) -> Actions:
        """Activate the law, or end it by the safe stop."""
        if enabled:
            self._enable(now)
        else:
            self.supervisor.disable()
        return self._after_change(now)

    def on_stop(self, now: float) -> Actions:
        """End the law until it is enabled, or the fault is cleared."""
        self.supervisor.stop()
        return self._after_change(now)

    def on_clear(self, now: float) -> Actions:
        """Change a fault, if there is one, to inactive."""
        self.supervisor.clear()
        return self._after_change(now)

    def enable_refusal(self, *, enabled: bool) -> str:
        """Return why the law cannot be activated; empty if it can, or if it is to end."""
        supervisor = self.supervisor
        if not enabled or supervisor.is_configured:
            return ''
        remedy = 'start the node again' if supervisor.is_shut_down else 'configure it first'
        return f'{supervisor.text}; {remedy}'

    def guide_refusal(self, *, enabled: bool) -> str:
        """Return why hand guiding cannot start or end; empty if it can."""
        if not enabled:
            return '' if self.supervisor.is_guided else 'hand guiding is not active'
        if self.controller.commands_rates:
            return 'hand guiding needs command_interface = effort or hybrid'
        if self.supervisor.is_fault:
            return f'{self.supervisor.text}; call ~/clear_fault first'
        return self.enable_refusal(enabled=enabled)

    def on_guide(self, now: float, *, enabled: bool) -> Actions:
        """Start hand guiding, or end it with an approach from the current position."""
        if enabled:
            self.supervisor.guide()
        else:
            self._enable(now)
        return self._after_change(now)

    @property
    def lifecycle(self) -> LifecycleState:
        """Return the state as a managed node."""
        return state_of(self.supervisor)

    def on_transition(self, number: int, label: str, now: float) -> Actions | None:
        """
        Perform a lifecycle transition; return None if it is not available in this state.

        Parameters
        ----------
        number, label
            Number and label of the transition in lifecycle_msgs; a label takes precedence.
        now
            Time in s.

        """
        transition = find_transition(self.lifecycle, number, label)
        if transition is None:
            return None
        if transition.label == 'configure':
            self.supervisor.configure()
            return self._after_change(now)
        if transition.label in ('activate', 'deactivate'):
            return self.on_enable(now, enabled=transition.label == 'activate')
        if transition.label == 'cleanup':
            self.supervisor.clean_up()
        else:
            self.supervisor.shut_down()
        return self._release(now)

    def on_reset_adaptation(self) -> Actions:
        """Reset the adaptation; the next tick records it."""
        self._apply_between(controller_events.ADAPTATION_RESET)
        return NOTHING

    def on_shutdown(self) -> Actions:
        """Send a void command as the last action of a controller in real time."""
        if not self.pacing.is_timed or self.states.order.last is None:
            return NOTHING
        self.drive.stop.release()
        return (Halt(self.states.order.last),)

    # Response to a state.

    def _respond(self, stamp: int, position: Array, velocity: Array, now: float) -> Actions:
        supervisor = self.supervisor
        if self._awaited and supervisor.is_active:
            return self._wait(stamp, position, velocity, self._awaited)
        reference = self.reference.at(stamp)
        if reference is not None:
            if not supervisor.is_active and supervisor.recover(Cause.REFERENCE, is_restart=True):
                self.drive.request_restart()
                self._outbox.add_state(self.supervisor)
        elif supervisor.is_active:
            reference = self._held(stamp, now)
        else:
            # The timeout of a reference that has ended starts with an activation.
            self.reference.restart_timeout()
        if supervisor.is_active:
            if reference is None:
                return self._wait(stamp, position, velocity, 'the trajectory (reference)')
            error = None
            # Ordinary ticks skip the call.
            if self.drive.is_running or not self._unfolds(stamp, position, velocity):
                error = self._compute(stamp, position, velocity, reference, now)
            if error is not None:
                return (*self._outbox.take(), Failure(error))
        self.states.pending = None
        outbox = self._outbox
        # Read again: the computation may have raised a fault.
        if supervisor.is_active:
            answer = outbox.stop_command if self.drive.is_unfolding else outbox.command
        elif self._stop_torque(stamp, position, velocity):
            answer = outbox.stop_command
        else:
            answer = outbox.void
        return outbox.respond(answer, stamp, self.states.pending_order, self.pacing)

    def _respond_to_pending(self, now: float) -> Actions:
        if self.states.pending is None:
            return NOTHING
        return self._respond(self.states.pending, self.states.position, self.states.velocity, now)

    def _held(self, stamp: int, now: float) -> Array | None:
        """Return the last position of a reference that ended; raise a fault after a time."""
        if not self.pacing.holds(stamp, self.states.pending, self.drive.computed):
            return None
        reference = self.reference.held_after(stamp, now)
        timeout = self.pacing.reference_timeout(self._values)
        if reference is not None and self.reference.is_overdue(now, timeout):
            self._fail(Cause.REFERENCE, f'{Cause.REFERENCE.value} for {timeout:g} s')
        return reference

    def _wait(self, stamp: int, position: Array, velocity: Array, reason: str) -> Actions:
        """Keep a state until its reference arrives, or the code of its law is ready."""
        self.states.pending = stamp
        if position is not self.states.position:
            self.states.keep(position, velocity)
        self._outbox.add_wait(reason)
        # A robot that this controller has moved must not continue with its last torque.
        if self.pacing.is_timed and self.drive.has_moved and self._halted != stamp:
            self._halted = stamp
            self._halt()
            self.drive.approach.start()
        return self._outbox.take()

    def _apply(self, event: str, stamp: int, position: Array, velocity: Array) -> None:
        """Apply an event to the drive, and record it."""
        self.drive.apply(event, stamp, position, velocity)
        self._outbox.add_record(self._values, event)

    def _apply_between(self, event: str) -> None:
        """Apply an event between two states, and record it."""
        states = self.states
        self._apply(event, states.order.last or 0, states.position, states.velocity)

    def _unfolds(self, stamp: int, position: Array, velocity: Array) -> bool:
        """Leave a singular joint position before the law starts; return False if it is regular."""
        drive = self.drive
        if drive.is_unfolding:
            if drive.has_unfolded(stamp, position, velocity):
                return False
        elif drive.should_unfold(position, velocity):
            self._apply(controller_events.UNFOLDED, stamp, position, velocity)
        else:
            return False
        return drive.unfold(stamp, position, velocity)

    def _compute(
        self, stamp: int, position: Array, velocity: Array, reference: Array, now: float
    ) -> UserError | None:
        """Compute the law, or raise a fault; return the error that ends the run instead."""
        drive, controller, pacing = self.drive, self.controller, self.pacing
        commanded = controller.commanded.copy()
        if not drive.is_running:
            self._start_law(stamp, position, velocity, now)
        elif pacing.is_timed:
            self._skip_ticks(stamp, position, now)
        if pacing.is_timed:
            # A controller that was late itself processes the states in its queue one by one.
            lateness = self.states.lateness.add(stamp, now)
            self._watch.note_age(lateness, now)
            if controller.is_compensated:
                controller.set_lateness(lateness)
        try:
            status = drive.compute(stamp, position, velocity, reference)
            if status & NOT_FINITE:
                raise diverged(stamp * 1e-9)
        except Exception as error:
            # A plug-in law can raise anything. A run without an end belongs to a user who tunes
            # gains: no request may end it. The safe stop continues from the last torque sent.
            controller.commanded[:] = commanded
            is_endless = self._outbox.is_endless
            if not is_endless and pacing.ends_with(error) and isinstance(error, UserError):
                self._error = error
                return error
            self._fail(Cause.LAW, ' '.join(str(error).split()), is_latched=True)
            return None
        if pacing.is_timed and self._values[RUNAWAY_DETECTION.name]:
            alarm = self._watch.look(controller.rates(velocity), now)
            if alarm is not None:
                cause = Cause.STATES if alarm.is_passing else Cause.RUNAWAY
                self._fail(cause, alarm.reason, is_latched=not alarm.is_passing)
        is_singular = status & SINGULAR != 0
        if is_singular != self._was_singular:
            self._was_singular = is_singular
            self._log_singularity(stamp, position, is_singular=is_singular)
        # The error that has ended the run, if any.
        return self._error

    def _start_law(self, stamp: int, position: Array, velocity: Array, now: float) -> None:
        """Apply the event that precedes a tick of the law."""
        self._halted = None
        event = self.drive.law_event()
        if event:
            self._apply(event, stamp, position, velocity)
            self._watch.restart()
            if event == controller_events.RESUMED:
                self._watch.note_late(now)

    def _skip_ticks(self, stamp: int, position: Array, now: float) -> None:
        """Account for the periods during which the last torque was held."""
        skipped = self.drive.skip_to(stamp)
        if skipped:
            self._watch.skip(skipped, now)
            self.states.counts.skipped += skipped
        line = self._layer.check(skipped + 1, position, now)
        if line is not None:
            self._outbox.add_line('warning', line)

    # Safe stop.

    def _stop_torque(self, stamp: int, position: Array, velocity: Array) -> bool:
        """Compute the torque of the safe stop for a state; False for a void command."""
        event = self.drive.stop_event(is_guided=self.supervisor.is_guided)
        if event:
            self._apply(event, stamp, position, velocity)
        return self.drive.update_stop(stamp, position, velocity)

    def _halt(self) -> None:
        """Send a torque of the safe stop, or a void command, without a new state."""
        stamp = self.states.stamp
        assert stamp is not None
        commands = self._stop_torque(stamp, self.states.position, self.states.velocity)
        self._outbox.add(HaltCommand(stamp) if commands else Halt(stamp))

    def _lose_states(self, now: float) -> Actions:
        """Command the last gravity torque for a short time, then send a void command."""
        if self.states.pending is not None:
            actions = self._respond_to_pending(now)
        elif self.states.order.last is None:
            return self._outbox.take()
        else:
            stamp = self.states.order.last
            if self.drive.is_active:
                self._outbox.add_record(self._values, controller_events.DEACTIVATED)
            is_guided = self.supervisor.is_guided
            commands = self.drive.balance(
                stamp, self.states.position, self.states.velocity, is_guided=is_guided
            )
            self._outbox.add(HaltCommand(stamp) if commands else Halt(stamp))
            actions = self._outbox.take()
        self.drive.is_stale = True
        if self.drive.stop.commands:
            self.states.void_due = now + BALANCE_TIME
        return actions

    # Changes of mode.

    def _enable(self, now: float) -> None:
        before = self.supervisor.activations
        self.supervisor.enable()
        if self.supervisor.activations != before:
            self.drive.request_restart()
            self.states.note_activation(now)

    def _release(self, now: float) -> Actions:
        """Send a void command, as a controller that has not moved the robot."""
        self._apply_between(controller_events.RELEASED)
        actions = self._after_change(now)
        if self.pacing.is_timed and self.drive.stop.commands:
            self._halt()
        return (*actions, *self._outbox.take())

    def _recover_states(self) -> None:
        self.states.was_mixed = False
        if self.supervisor.recover(Cause.STATES, is_restart=False):
            self._outbox.add_state(self.supervisor)

    def _lacks_states(self) -> bool:
        supervisor = self.supervisor
        return self.drive.is_stale or supervisor.cause is Cause.STATES

    def _restart(self, order: Order, now: float) -> None:
        """Restart the law at the next computed tick."""
        if order is Order.BACK:
            text = 'time was set back; the controller restarts'
            self._outbox.add_line('info', text)
        else:
            self.states.counts.gaps += 1
            if self._outbox.throttle.is_due('gap', now):
                text = 'states were missing for longer than state_timeout; the controller restarts'
                self._outbox.add_line('warning', text)
        self._watch.note_late(now)
        self.states.lateness.restart()
        # In the restarted run, this controller has not yet moved the robot.
        is_new_run = order is Order.BACK and not self.pacing.is_timed
        self.drive.restart(is_new_run=is_new_run)
        self.states.pending = None

    def _after_change(self, now: float) -> Actions:
        """Return the actions after the supervisor may have changed between two states."""
        was_active = self._outbox.was_active
        self._outbox.add_state(self.supervisor)
        if self.supervisor.is_active or not (was_active or self.states.pending is not None):
            return self._outbox.take()
        if self.states.pending is not None:
            return self._respond_to_pending(now)
        if self.pacing.is_timed and self.states.order.last is not None:
            self._halt()
        return self._outbox.take()

    def _fail(self, cause: Cause, reason: str, *, is_latched: bool = False) -> None:
        self.supervisor.fail(cause, reason, is_latched=is_latched)
        self._outbox.add_state(self.supervisor)

    def _set_pacing(self, pacing: Pacing) -> None:
        self.pacing, self.drive.is_timed = pacing, pacing.is_timed
        self.states.order.gap_ns = pacing.gap_ns(self._values)
        self.states.timeout = pacing.state_timeout(self._values)

    def _log_singularity(self, stamp: int, position: Array, *, is_singular: bool) -> None:
        mechanism, at = self.controller.mechanism, f'at t = {stamp * 1e-9:.3f} s'
        if not is_singular:
            text = f'{at} {mechanism.lost} has left the singularity or the end of a range'
            self._outbox.add_line('info', text)
            return
        at_end = mechanism.at_range_ends(position[None, -len(mechanism.joints):])[0]
        self._outbox.add_line(
            'warning',
            f'{at} {mechanism.range_ends_text(at_end)}; motion for the task stops there'
            if at_end.any()
            else f'{at} {mechanism.lost} is close to singular ({mechanism.singular}); motion'
            ' along the lost direction is damped',
        )
