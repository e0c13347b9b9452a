# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Description of a robot with other inertial parameters."""

from __future__ import annotations

from typing import cast
import xml.etree.ElementTree as ElementTree

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import MutableValues
from masmc_ros.robot.declaration import URDF
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.link_inertia import pseudo_inertia
from masmc_ros.robot.tree.spatial import PER_BODY
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism, TreeMechanism
from masmc_ros.robot.tree.tree_parameters import BASE_TYPE
import numpy as np

_AHEAD = 0.05
"""Smallest distance in m of a frame ahead of the axle whose position determines the base."""


def values_of(robot: Robot, theta: Array) -> MutableValues:
    """
    Return the values of `robot.` parameters of a robot with these inertial parameters (p).

    The description is a text. The first link of each moving body has the inertia of the body, and
    links that are fixed to it have none. Wheels keep theirs.
    """
    mechanism = cast(TreeMechanism, robot.mechanism)
    bodies = theta.reshape(-1, PER_BODY)
    values = dict(mechanism.choice)
    values[URDF] = _text(mechanism, bodies)
    # The wheels are part of the base, which so far counts them twice.
    doubled = tree_mechanism(values).robot.inertial_parameters[0] - bodies[0]
    base = bodies[0] - doubled
    values[URDF] = _text(mechanism, np.vstack([base, bodies[1:]]))
    return values


def _text(mechanism: TreeMechanism, bodies: Array) -> str:
    """Return the description with the inertial parameters (B, 10) of the bodies."""
    robot = mechanism.robot
    own = {} if robot.wheels is None else {joint.child for joint in robot.wheels.joints}
    root = mechanism.frames[0][1]
    first = {link: number for number, link in enumerate([root, *(j.child for j in robot.moving)])}
    tree = ElementTree.fromstring(mechanism.text)
    for link in tree.findall('link'):
        name = link.get('name', '')
        if name in own:
            continue
        for inertial in link.findall('inertial'):
            link.remove(inertial)
        if name in first and bodies[first[name]].any():
            link.append(_inertial(bodies[first[name]]))
    ElementTree.indent(tree)
    return ElementTree.tostring(tree, encoding='unicode')


def _inertial(moments: Array) -> ElementTree.Element:
    """Return the element of a body's moments (10) about the origin of its link."""
    pseudo = pseudo_inertia(moments.tolist())
    mass = pseudo[3, 3]
    centre = pseudo[:3, 3] / mass
    second = pseudo[:3, :3] - mass * np.outer(centre, centre)
    inertia = np.trace(second) * np.eye(3) - second
    element = ElementTree.Element('inertial')
    place = ' '.join(repr(float(x)) for x in centre)
    ElementTree.SubElement(element, 'origin', xyz=place, rpy='0 0 0')
    ElementTree.SubElement(element, 'mass', value=repr(float(mass)))
    names = (('ixx', 0, 0), ('ixy', 0, 1), ('ixz', 0, 2), ('iyy', 1, 1), ('iyz', 1, 2),
             ('izz', 2, 2))  # fmt: skip
    entries = {name: repr(float(inertia[i, j])) for name, i, j in names}
    ElementTree.SubElement(element, 'inertia', entries)
    return element


def exciting_task(robot: Robot) -> MutableValues:
    """Return the values of parameters whose task determines the motion of all joints."""
    mechanism = cast(TreeMechanism, robot.mechanism)
    kind = BASE_TYPE.of(mechanism.choice)
    if kind == 'fixed':
        return {'robot.task': ('joints',)}
    if kind == 'omnidirectional':
        return {'robot.task': ('joints', 'base')}
    root = mechanism.frames[0][1]
    ahead = {
        link: abs(frame.offset[0])
        for link, frame in mechanism.robot.frames.items()
        if frame.body == 0 and link != root
    }
    link = max(ahead, key=lambda name: ahead[name], default=root)
    if ahead.get(link, 0.0) < _AHEAD:
        raise InputError(
            f'no link of the base is {_AHEAD:g} m ahead of its axle; expected one, such as that '
            'of a laser, whose position determines the motion of the base'
        )
    return {'robot.task': ('joints', f'planar {link}')}
