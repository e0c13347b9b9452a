# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robot and paths in the scene of the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from masmc_ros.aliases import Array, Numbers
from masmc_ros.robot.declaration import ODOM_FRAME
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.urdf import read_urdf
from masmc_ros.robot.visuals import mesh_files, Visual, visual_shapes
import numpy as np
from numpy.typing import NDArray
import trimesh
from viser import ArrowsHandle, FrameHandle, LineSegmentsHandle, SceneApi

_WORLD = '/world'
"""Node of the frame odom. It moves opposite to the robot that the camera follows."""

_DESIRED, _ACTUAL, _BONE = (0, 114, 178), (213, 94, 0), (90, 90, 100)
"""Colours of the paths, and of the lines of a robot without shapes."""

_THICKNESS = 0.008
"""Thickness of the lines in m."""

_TORQUE, _DISTURBANCE = (0, 158, 115), (204, 121, 167)
"""Colours of the arrows, which are different from those of the paths."""

_LONGEST = 0.4
"""Length of an arrow in m of the largest torque so far."""

_ROTATION = (6, 3, 4, 5)
"""Places of w, x, y, z in a transform x, y, z, qx, qy, qz, qw."""


class RobotScene:
    """A robot with the shapes of its description, and its desired and actual path."""

    def __init__(
        self, scene: SceneApi, robot: Robot, description: str, log: Callable[[str], object]
    ) -> None:
        """
        Build the scene in place of a previous one.

        Parameters
        ----------
        scene
            Scene of the page.
        robot
            Robot.
        description
            Its URDF, whose links have the names of the frames.
        log
            Function that logs a line about meshes that are not shown.

        Raises
        ------
        InputError
            If the description is invalid.

        """
        shapes, meshes = visual_shapes(description), mesh_files(description)
        scene.reset()
        self._robot = robot
        self._world = scene.add_frame(_WORLD, show_axes=False)
        scene.add_grid(
            f'{_WORLD}/grid', infinite_grid=True, fade_distance=15.0, shadow_opacity=0.0
        )
        paths = {ODOM_FRAME: _WORLD}
        self._frames: list[FrameHandle] = []
        for number, (parent, child) in enumerate(robot.mechanism.frames):
            paths[child] = f'{paths[parent]}/{number}'
            self._frames.append(scene.add_frame(paths[child], show_axes=False))
        self._transforms = np.full((len(self._frames), 7), np.nan)
        drawn = _draw(scene, paths, shapes, meshes, log)
        if not drawn:
            self._draw_bones(scene, paths)
        self._arrows = _arrows(scene, paths, robot, description)
        self._has_arrows, self._largest = False, np.finfo(float).tiny
        self._desired = _line(scene, 'desired', _DESIRED)
        self._actual = _line(scene, 'actual', _ACTUAL)
        self.is_followed = True
        # Shadows cost much on a machine without a graphics card.
        scene.configure_default_lights(enabled=True, cast_shadow=False)

    def _draw_bones(self, scene: SceneApi, paths: Mapping[str, str]) -> None:
        """Draw a line from each frame to those that it carries."""
        origins = self._robot.frame_origins
        for number, (parent, _) in enumerate(self._robot.mechanism.frames):
            if parent != ODOM_FRAME and np.any(origins[number]):
                points = np.stack((np.zeros(3), origins[number]))[None]
                scene.add_line_segments(
                    f'{paths[parent]}/to_{number}', points, _BONE, thickness=3.0 * _THICKNESS
                )

    def move(self, position: Array) -> None:
        """Show the robot at positions (n) in the order of joint_states, m and rad."""
        transforms = self._robot.frame_transforms(position[None])[0]
        moved = ~(np.abs(transforms - self._transforms) < 1e-6).all(axis=1)
        for i in np.flatnonzero(moved):
            self._frames[i].position = transforms[i, :3]
            self._frames[i].wxyz = transforms[i, _ROTATION]
        self._transforms = transforms
        # The camera stays where the viewer has put it relative to the robot.
        shift = -transforms[0, :3] * (1.0, 1.0, 0.0) if self.is_followed else np.zeros(3)
        if not np.array_equal(shift, self._world.position):
            self._world.position = shift

    def show_torques(self, torque: Array, disturbance: Array) -> None:
        """Show torques and disturbances (joints) in N·m as arrows along the axes of the joints."""
        self._has_arrows = True
        self._largest = max(self._largest, np.abs((torque, disturbance)).max())
        for joint, axis, arrows in self._arrows:
            for arrow, value in zip(arrows, (torque[joint], disturbance[joint]), strict=True):
                end = axis * value * _LONGEST / self._largest
                arrow.visible = bool(np.linalg.norm(end) > _THICKNESS)
                arrow.points = np.stack((np.zeros(3), end))[None].astype(np.float32)

    def hide_torques(self) -> None:
        """Hide the arrows."""
        if not self._has_arrows:
            return
        self._has_arrows = False
        for _, _, arrows in self._arrows:
            for arrow in arrows:
                arrow.visible = False

    def show_desired(self, points: Array) -> None:
        """Show the desired path of the first point: positions (n, 3) in m."""
        self._desired.points = segments(points)

    def show_actual(self, points: Array) -> None:
        """Show the actual path of the first point: positions (n, 3) in m."""
        self._actual.points = segments(points)


def path_of(robot: Robot, positions: Array) -> Array:
    """
    Return the path (n, 3) in m of the first point of a robot.

    A robot without places has that of its base.

    Parameters
    ----------
    robot
        Robot.
    positions
        Positions (n, positions) in the order of joint_states, m and rad.

    """
    if robot.mechanism.places:
        return places_of(robot, robot.task_positions(positions))
    path: Array = robot.frame_transforms(positions)[:, 0, :3]
    return path


def places_of(robot: Robot, task: Array) -> Array:
    """
    Return the positions (n, 3) in m of the first point in task coordinates (n, axes).

    Points of a plane have the height of their frame. Without places there are no positions.
    """
    places = robot.mechanism.places
    if not places:
        return np.zeros((0, 3))
    points = task[:, places[0].axes]
    if points.shape[1] == 3:
        return points
    return np.column_stack((points, np.full(len(points), robot.height)))


def segments(points: Array) -> NDArray[np.float32]:
    """Return a line through points (n, 3) as segments (n - 1, 2, 3); one of length 0 if n < 2."""
    if len(points) < 2:
        return np.zeros((1, 2, 3), np.float32)
    return np.stack((points[:-1], points[1:]), axis=1).astype(np.float32)


def _arrows(
    scene: SceneApi, paths: Mapping[str, str], robot: Robot, description: str
) -> list[tuple[int, Array, tuple[ArrowsHandle, ArrowsHandle]]]:
    """Add hidden arrows; return the number, the axis and the arrows of each joint of the URDF."""
    known = read_urdf(description, 'the description').joints
    arrows = []
    for number, joint in enumerate(robot.mechanism.joints):
        if joint.name not in known or known[joint.name].child not in paths:
            continue
        path = paths[known[joint.name].child]
        torque, disturbance = (
            scene.add_arrows(
                f'{path}/{name}_{number}',
                np.zeros((1, 2, 3)),
                colour,
                shaft_radius=1.5 * _THICKNESS,
                head_radius=3.0 * _THICKNESS,
                head_length=6.0 * _THICKNESS,
                visible=False,
            )
            for name, colour in (('torque', _TORQUE), ('disturbance', _DISTURBANCE))
        )
        arrows.append((number, np.array(known[joint.name].axis), (torque, disturbance)))
    return arrows


class _Mesh(NamedTuple):
    vertices: Array
    faces: Array


def _draw(
    scene: SceneApi,
    paths: Mapping[str, str],
    shapes: Sequence[Visual],
    meshes: Mapping[str, Path],
    log: Callable[[str], object],
) -> int:
    """Draw the shapes of links with a frame; return their number."""
    drawn, missing = 0, []
    loaded: dict[str, _Mesh | None] = {}
    for number, shape in enumerate(shapes):
        if shape.link not in paths:
            continue
        name = f'{paths[shape.link]}/shape_{number}'
        colour = _bytes(shape.colour)
        if shape.kind == 'mesh':
            if shape.mesh not in loaded:
                loaded[shape.mesh] = _loaded(meshes.get(shape.mesh))
            mesh = loaded[shape.mesh]
            if mesh is None:
                missing.append(shape.mesh)
                continue
            vertices = mesh.vertices * shape.sizes
            scene.add_mesh_simple(f'{name}/mesh', vertices, mesh.faces, color=colour)
        elif shape.kind == 'box':
            scene.add_box(f'{name}/box', colour, np.array(shape.sizes))
        elif shape.kind == 'sphere':
            scene.add_icosphere(f'{name}/sphere', shape.sizes[0], colour)
        else:
            scene.add_cylinder(f'{name}/cylinder', shape.sizes[0], shape.sizes[1], colour)
        scene.add_frame(
            name,
            show_axes=False,
            position=np.array(shape.offset),
            wxyz=np.array(shape.quaternion),
        )
        drawn += 1
    if missing:
        log(f'{len(missing)} meshes are not shown: not found or not readable, first {missing[0]}')
    return drawn


def _bytes(colour: Numbers) -> tuple[int, int, int]:
    """Return a colour with parts from 0 to 255."""
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue


def _loaded(path: Path | None) -> _Mesh | None:
    """Return the mesh in a file; None if it cannot be read."""
    if path is None:
        return None
    try:
        mesh = trimesh.load(path, force='mesh')
    # Readers of many formats raise errors of many kinds.
    except Exception:
        return None
    if not isinstance(mesh, trimesh.Trimesh) or mesh.is_empty:
        return None
    return _Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def _line(scene: SceneApi, name: str, colour: tuple[int, int, int]) -> LineSegmentsHandle:
    return scene.add_line_segments(
        f'{_WORLD}/{name}', segments(np.zeros((0, 3))), colour, thickness=_THICKNESS
    )
