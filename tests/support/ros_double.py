"""A small double of rclpy and tf2_ros. Its messages are made of the definitions that rosbags has of ROS
2, with the checks that rclpy's make: fields that exist, of their types."""

import sys
import types
from functools import cache

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

INTEGERS = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"}


@cache
def store():
    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def message_class(name):
    """The class of a message, such as "nav_msgs/msg/Odometry"; its instances begin with zeros."""
    constants, fields = store().fielddefs[name]
    defined = dict(fields)

    def begin(self):
        for field, kind in fields:
            object.__setattr__(self, field, _zero(kind))

    def put(self, field, value):
        assert field in defined, f"{name} has no field {field}"
        assert _fits(defined[field], value), f"{name}.{field} cannot be {value!r}"
        object.__setattr__(self, field, value)

    members = {key: _constant(kind, value) for key, kind, value in constants}
    members |= {"__init__": begin, "__setattr__": put, "of": name}
    return type(name.rpartition("/")[2], (), members)


def _constant(kind, value):
    return bytes([value]) if kind == "byte" else value


def _zero(kind):
    which, inner = kind
    if which == Nodetype.NAME:
        return message_class(inner)()
    if which == Nodetype.ARRAY:
        return np.zeros(inner[1])
    if which == Nodetype.SEQUENCE:
        return []
    return {"string": "", "byte": b"\0", "bool": False}.get(
        inner[0], 0 if inner[0] in INTEGERS else 0.0
    )


def _fits(kind, value):
    which, inner = kind
    if which == Nodetype.NAME:
        return getattr(value, "of", "") == inner
    if which in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        right = len(value) == inner[1] if which == Nodetype.ARRAY else True
        return right and all(_fits(inner[0], each) for each in value)
    if inner[0] in INTEGERS:
        return isinstance(value, int)
    types_of = {"string": str, "byte": bytes, "bool": bool}
    return isinstance(value, types_of.get(inner[0], float))


def as_rosbags(message):
    """The same message as rosbags has it, which it can serialise."""
    made = store().types[message.of]
    fields = store().fielddefs[message.of][1]
    return made(**{field: _as_rosbags(kind, getattr(message, field)) for field, kind in fields})


def _as_rosbags(kind, value):
    which, inner = kind
    if which == Nodetype.NAME:
        return as_rosbags(value)
    if which == Nodetype.SEQUENCE:
        return [_as_rosbags(inner[0], each) for each in value]
    if which == Nodetype.ARRAY:
        return np.array(value, float)
    return value[0] if isinstance(value, bytes) else value


class TransformException(Exception):
    """As tf2_ros has it."""


class Ros:
    """What a node meets: parameters, transforms, a clock; and what it did with them."""

    def __init__(self, parameters, transforms=()):
        self.parameters, self.transforms = parameters, dict(transforms)
        self.now, self.told, self.published = 0, [], {}
        self.subscriptions, self.timers, self.jumps = {}, [], []
        self.node = None

    # ---- what a test does

    def send(self, topic, message, now=None):
        self.now = self.now if now is None else now
        self.subscriptions[topic][1](message)

    def tick(self):
        for timer in self.timers:
            timer()

    def jump(self, seconds):
        """The clock steps."""
        nanoseconds = round(seconds * 1e9)
        self.now += nanoseconds
        for threshold, callback in self.jumps:
            if nanoseconds <= threshold.min_backward.nanoseconds:
                callback(types.SimpleNamespace(delta=Duration(nanoseconds=nanoseconds)))

    # ---- what stands for ROS

    def modules(self):
        """{name: module} to import instead of ROS."""
        ros = self
        messages = {}
        for name in store().types:
            package, _, kind = name.split("/")
            messages.setdefault(package, {})[kind] = name
        found = {}
        for package in ("std_msgs", "sensor_msgs", "geometry_msgs", "nav_msgs", "diagnostic_msgs"):
            classes = {kind: message_class(name) for kind, name in messages[package].items()}
            found[package] = _module(package)
            found[f"{package}.msg"] = _module(f"{package}.msg", **classes)
        rclpy = {
            "": {"init": lambda args=None: None, "spin": self._spin, "try_shutdown": lambda: None},
            ".clock": {"JumpThreshold": JumpThreshold},
            ".duration": {"Duration": Duration},
            ".executors": {"ExternalShutdownException": type("Shut", (Exception,), {})},
            ".node": {"Node": type("Node", (Node,), {"ros": ros})},
            ".qos": {
                "QoSProfile": lambda **given: given,
                "ReliabilityPolicy": types.SimpleNamespace(BEST_EFFORT=2),
            },
            ".time": {"Time": lambda nanoseconds=0: nanoseconds},
        }
        found |= {f"rclpy{name}": _module(f"rclpy{name}", **own) for name, own in rclpy.items()}
        found["tf2_ros"] = _module(
            "tf2_ros",
            Buffer=lambda: types.SimpleNamespace(
                lookup_transform=self._lookup, clear=lambda: self.told.append("tf cleared")
            ),
            TransformListener=lambda buffer, node: None,
            TransformBroadcaster=lambda node: types.SimpleNamespace(
                sendTransform=lambda message: ros.published.setdefault("/tf", []).append(message)
            ),
            TransformException=TransformException,
        )
        return found

    def _spin(self, node):
        self.node = node

    def _lookup(self, target, source, time):
        if (target, source) not in self.transforms:
            raise TransformException(f"{source} passed to lookupTransform does not exist")
        translation, rotation = self.transforms[target, source]
        message = message_class("geometry_msgs/msg/TransformStamped")()
        for name, value in zip("xyz", translation):
            setattr(message.transform.translation, name, float(value))
        for name, value in zip("xyzw", rotation):
            setattr(message.transform.rotation, name, float(value))
        return message


def _module(name, **members):
    module = types.ModuleType(name)
    vars(module).update(members)
    return module


class Duration:
    def __init__(self, *, seconds=0, nanoseconds=0):
        self.nanoseconds = round(seconds * 1e9) + nanoseconds


class JumpThreshold:
    def __init__(self, *, min_forward, min_backward, on_clock_change=True):
        assert min_backward.nanoseconds < 0  # rclpy refuses others
        self.min_forward, self.min_backward = min_forward, min_backward


class Node:
    """The part of rclpy's Node that the node uses."""

    ros: Ros

    def __init__(
        self,
        name,
        *,
        allow_undeclared_parameters=False,
        automatically_declare_parameters_from_overrides=False,
    ):
        assert automatically_declare_parameters_from_overrides
        self._name = name

    def get_name(self):
        return self._name

    def destroy_node(self):
        self.ros.told.append("destroyed")

    def get_parameters_by_prefix(self, prefix):
        assert prefix == ""
        given = self.ros.parameters
        return {name: types.SimpleNamespace(value=value) for name, value in given.items()}

    def create_subscription(self, kind, topic, callback, quality):
        self.ros.subscriptions[topic] = kind, callback

    def create_publisher(self, kind, topic, depth):
        sent = self.ros.published.setdefault(topic, [])

        def publish(message):
            assert type(message) is kind
            sent.append(message)

        return types.SimpleNamespace(publish=publish)

    def create_timer(self, seconds, callback):
        self.ros.timers.append(callback)

    def get_clock(self):
        ros = self.ros
        return types.SimpleNamespace(
            now=lambda: types.SimpleNamespace(nanoseconds=ros.now),
            create_jump_callback=lambda threshold, *, post_callback: ros.jumps.append(
                (threshold, post_callback)
            ),
        )

    def get_logger(self):
        ros = self.ros
        return types.SimpleNamespace(warning=lambda text, *, once=False: ros.told.append(text))


def run_node(monkeypatch, parameters, transforms=()):
    """(Ros, exit code of the node's main), spun until nothing more comes."""
    ros = Ros(parameters, transforms)
    for name, module in ros.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "strapdown_ros2.node", raising=False)
    from strapdown_ros2.node import main

    code = main()
    monkeypatch.delitem(sys.modules, "strapdown_ros2.node", raising=False)
    return ros, code
