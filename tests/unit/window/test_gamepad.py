"""The gamepad, by a stand-in for GLFW: dead zone, sticks, triggers, buttons, pads that come and go."""

from types import SimpleNamespace

import glfw as real
import numpy as np
import pytest
from window_session import session

from pointglass.viewer.window.flight.gamepad import DEAD_ZONE, STILL, Gamepad, Push, beyond_dead_zone
from pointglass.viewer.window.interaction import controls
from pointglass.viewer.window.shell.devices import Devices


class FakeGlfw:
    """A GLFW with one place for a gamepad.  state: what the pad says; reads: how often it was asked."""

    def __init__(self, connected=True):
        self.connected, self.reads, self.callback = connected, 0, None
        self.state = SimpleNamespace(axes=[0.0, 0.0, 0.0, 0.0, -1.0, -1.0], buttons=[0] * 15)

    def __getattr__(self, name):
        return getattr(real, name)

    def set_joystick_callback(self, callback):
        self.callback = callback

    def joystick_is_gamepad(self, number):
        return self.connected and number == real.JOYSTICK_3

    def get_gamepad_state(self, number):
        assert number == real.JOYSTICK_3
        self.reads += 1
        return self.state if self.connected else None

    def plug(self, connected):
        self.connected = connected
        assert self.callback is not None
        self.callback(real.JOYSTICK_3, real.CONNECTED if connected else real.DISCONNECTED)


def test_the_dead_zone_is_a_disc_and_the_rest_of_the_way_is_smooth(seed):
    rng = np.random.default_rng(seed)
    for x, y in rng.uniform(-1, 1, (200, 2)):
        length, out = np.hypot(x, y), np.array(beyond_dead_zone(x, y))
        if length <= DEAD_ZONE:
            assert (out == 0).all()
        else:
            assert np.isclose(np.linalg.norm(out), min((length - DEAD_ZONE) / (1 - DEAD_ZONE), 1.0))
            assert np.allclose(np.cross([*out, 0], [x, y, 0]), 0) and out @ (x, y) > 0
    assert beyond_dead_zone(float("nan"), 0.0) == (0.0, 0.0)


def test_sticks_and_triggers_push():
    fake = FakeGlfw()
    pad = Gamepad(fake, lambda: True)
    assert pad.connected and pad.read() == (STILL, [])
    fake.state.axes = [1.0, 0.0, 0.0, 0.0, -1.0, -1.0]
    assert pad.read()[0] == Push(right=1.0)
    fake.state.axes = [0.0, -1.0, 0.0, 0.0, -1.0, -1.0]
    assert pad.read()[0].forward == pytest.approx(1.0), "GLFW's sticks are negative upward"
    fake.state.axes = [0.0, 0.0, 0.0, -1.0, -1.0, 1.0]
    push = pad.read()[0]
    assert push.tilt == pytest.approx(1.0) and push.up == pytest.approx(1.0)
    fake.state.axes = [0.0, 0.0, 0.1, 0.1, 1.0, 1.0]
    assert pad.read()[0] == STILL, "both triggers, and a worn stick"


def test_buttons_act_once_and_every_action_is_known():
    fake = FakeGlfw()
    pad = Gamepad(fake, lambda: True)
    fake.state.buttons[real.GAMEPAD_BUTTON_A] = 1
    assert [pad.read()[1] for _ in range(3)] == [["walk"], [], []]
    fake.state.buttons[real.GAMEPAD_BUTTON_A] = 0
    pad.read()
    for button, action in ((real.GAMEPAD_BUTTON_B, "home"), (real.GAMEPAD_BUTTON_START, "help"),
                           (real.GAMEPAD_BUTTON_LEFT_BUMPER, "slower"), (real.GAMEPAD_BUTTON_RIGHT_BUMPER, "faster")):
        fake.state.buttons = [0] * 15
        fake.state.buttons[button] = 1
        assert pad.read()[1] == [action]
    keys = {control.action for control in controls.ALL if control.kind == "press"}
    assert {"walk", "home", "help"} <= keys, "the pad's actions are keys', too"


def test_nothing_is_read_where_no_pad_is_connected_and_pads_come_and_go():
    fake = FakeGlfw(connected=False)
    pad = Gamepad(fake, lambda: True)
    assert not pad.connected and pad.read() == (STILL, []) and fake.reads == 0
    fake.plug(True)
    fake.state.axes[0] = 1.0
    assert pad.connected and pad.read()[0].right == 1.0
    fake.connected = False  # pulled, and not reported yet
    assert pad.read() == (STILL, [])
    fake.plug(False)
    assert not pad.connected


def test_a_window_without_the_focus_ignores_the_pad():
    fake, focus = FakeGlfw(), [False]
    pad = Gamepad(fake, lambda: focus[0])
    fake.state.axes[0] = 1.0
    fake.state.buttons[real.GAMEPAD_BUTTON_A] = 1
    assert pad.read() == (STILL, []) and fake.reads == 0
    focus[0] = True
    assert pad.read() == (Push(right=1.0), ["walk"])


def test_a_half_pushed_stick_moves_slower_and_the_right_one_turns():
    distances = []
    for share in (0.5, 1.0):
        made, clock = session()
        made.advance()
        start = made.flight.state
        made.flight.push = Push(forward=share)
        for _ in range(60):
            clock.now += 1 / 60
            assert made.advance() or clock.now < 100.05
        distances.append(float(np.linalg.norm(made.flight.state.position - start.position)))
        assert made.flight.moving
        made.flight.push = STILL
        for _ in range(120):
            clock.now += 1 / 60
            made.advance()
        assert not made.flight.under_way
    assert distances[0] == pytest.approx(distances[1] / 2, rel=0.02)
    made, clock = session()
    made.advance()
    right = made.flight.state.right
    made.flight.push = Push(turn=1.0, tilt=0.5)
    pitch = made.flight.state.pitch
    for _ in range(12):
        clock.now += 1 / 60
        made.advance()
    assert made.flight.state.forward @ right > 0.2 and made.flight.state.pitch > pitch


class FakeSpaceMouse(FakeGlfw):
    """A GLFW with a 3D mouse, and a keyboard that also calls itself a joystick."""

    def __init__(self):
        super().__init__(connected=False)
        self.there, self.axes = True, [0.0] * 6

    def joystick_present(self, number):
        return number == real.JOYSTICK_1 or (self.there and number == real.JOYSTICK_5)

    def get_joystick_name(self, number):
        return b"3Dconnexion SpaceMouse Compact" if number == real.JOYSTICK_5 else b"A keyboard"

    def get_joystick_axes(self, number):
        assert number in (real.JOYSTICK_1, real.JOYSTICK_5)
        return (self.axes, len(self.axes)) if self.there or number == real.JOYSTICK_1 else (None, 0)

    def get_window_attrib(self, window, attribute):
        assert attribute == real.FOCUSED
        return window == "focused"


def devices_of(fake, made, window="focused"):
    """Devices of a window that shows a session."""
    host = SimpleNamespace(glfw=fake, window=window, session=made, asking=False, wake=lambda: None, act=lambda action: None)
    return host, Devices(host)


def test_a_3d_mouse_is_found_comes_and_goes_and_rests_while_a_question_is_open():
    fake, (made, _) = FakeSpaceMouse(), session()
    host, devices = devices_of(fake, made)
    assert devices.connected and devices.space_mouse.connected and not devices.gamepad.connected
    devices.follow()
    assert made.flight.twist == STILL and not made.flight.under_way
    for axes, push in (([1.0, 0, 0, 0, 0, 0], Push(right=1.0)), ([0, -1.0, 0, 0, 0, 0], Push(forward=1.0)),
                       ([0, 0, -1.0, 0, 0, 0], Push(up=1.0)), ([0, 0, 0, 1.0, 0, 0], Push(tilt=1.0)),
                       ([0, 0, 0, 0, 1.0, 0], STILL), ([0, 0, 0, 0, 0, 1.0], Push(turn=1.0)),
                       ([0.03, -0.03, float("nan"), 0, 0, 0], STILL)):
        fake.axes = axes
        devices.follow()
        assert made.flight.twist == push, axes
    fake.axes = [1.0] * 6
    made.notices.say("A question", "is open")
    devices.follow()
    assert made.flight.twist == STILL
    made.notices.message, host.window = None, "another"
    devices.follow()
    assert made.flight.twist == STILL, "it is another program's"
    host.window, fake.there = "focused", False  # pulled, and not reported yet
    devices.follow()
    assert made.flight.twist == STILL
    fake.plug(False)
    devices.follow()
    assert made.flight.twist is None and not devices.connected
    fake.there = True
    fake.plug(False)
    devices.follow()
    assert devices.space_mouse.connected and made.flight.twist.right == 1.0


@pytest.mark.parametrize("mouse, sign", [("fly", 1.0), ("orbit", -1.0), ("cad", -1.0)])
def test_a_3d_mouse_moves_the_camera_or_where_drags_orbit_the_scene(mouse, sign):
    def moved(axes, factor=1.0):
        fake, (made, clock) = FakeSpaceMouse(), session()
        made.flight.mouse, made.flight.twist_speed = mouse, factor
        _, devices = devices_of(fake, made)
        made.advance()
        start, fake.axes = made.flight.state, axes
        for _ in range(20):
            clock.now += 1 / 60
            devices.follow()
            made.advance()
        return start, made.flight.state, made.flight.middle

    start, end, _ = moved([1.0, 0, 0, 0, 0, 0])
    assert sign * ((end.position - start.position) @ start.right) > 0.1 and end.yaw == start.yaw
    slow = moved([1.0, 0, 0, 0, 0, 0], 0.25)[1]
    assert np.linalg.norm(slow.position - start.position) < 0.5 * np.linalg.norm(end.position - start.position)
    start, end, middle = moved([0, 0, 0, 0.5, 0, 1.0])
    if mouse == "fly":
        assert np.array_equal(end.position, start.position) and end.forward @ start.right > 0.1 and end.pitch > start.pitch
    else:
        far = [np.linalg.norm(state.position - middle) for state in (start, end)]
        assert far[0] == pytest.approx(far[1]) and np.linalg.norm(end.position - start.position) > 0.05
        assert end.pitch < start.pitch and end.forward @ start.right < -0.1, "right, its top to the person"
