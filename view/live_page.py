"""The page of a running vehicle."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np
import viser

from fsw.autopilot.signals import Vec3
from view import live_link, panels
from view.flight import Trail
from view.live_link import Answer, VehicleLink
from view.page import Server
from view.plots import Plot
from view.scene import Scene
from view.stage import Stage
from view.tlog_flight import curves_of
from view.vehicle import tip_of

_FRAME_S: Final = 1.0 / 30.0  # a frame takes some milliseconds more
_TEXT_S: Final = 0.25
_PLOT_S: Final = 1.0
_KEPT_S: Final = 0.2  # between two scenes that the curves are drawn from
_CURVE_SCENES: Final = 600  # two minutes
_TRAIL_S: Final = 0.1
_STILL_S: Final = 1.0  # between two pictures of a vehicle whose clock stands
_PIECE: Final = 11  # points of a piece of the trail
_PIECES: Final = 120  # of the trail: two minutes
_REACH: Final = 2.5  # m, of walls and floor about where the vehicle was found
_NAN: Final = math.nan
_FOUND: Final = 40  # messages and parameters at a time


class LivePage:
    """Shows a running vehicle until it is closed."""

    def __init__(self, server: Server, link: VehicleLink) -> None:
        self._server, self._link = server, link
        self._ended = threading.Event()
        self._asked = ThreadPoolExecutor(1)
        self._framed = False
        self._recent: deque[Scene] = deque(maxlen=_CURVE_SCENES)
        self._trail: list[tuple[Vec3, float]] = []
        self._piece = 0
        self._wanted = {"messages": "", "parameters": ""}
        self._gizmo: Any = None
        self._drawn_t = _NAN
        self._undrawn = ""  # why a frame was not drawn, as it was said last
        self._frames = 0
        self._due = {"text": 0.0, "plot": 0.0, "kept": 0.0, "trail": 0.0, "still": 0.0}
        self._airframe = link.airframe
        self.stage = Stage(server, self._airframe)
        self.stage.frame(server, ((-_REACH,) * 3, (_REACH, _REACH, 0.0)))
        self._build()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop drawing."""
        self._ended.set()
        self._asked.shutdown(wait=False, cancel_futures=True)
        self._thread.join()

    def _build(self) -> None:
        gui = self._server.gui
        self._answer = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Now"):
            self._now = gui.add_html("")
        with tabs.add_tab("Command"):
            self._build_commands()
        with tabs.add_tab("Curves"):
            blank = [Scene(t=0.0), Scene(t=1.0)]
            self._plots = [Plot(gui, c, 0.0, 170) for c in curves_of(blank, self._airframe)]
        with tabs.add_tab("Events"):
            self._events = gui.add_html("")
        with tabs.add_tab("Messages"):
            self._search("messages", "name of a message")
            self._messages = gui.add_html("")
        with tabs.add_tab("Parameters"):
            gui.add_button("read from the vehicle").on_click(
                lambda _: self._link.ask_for_parameters()
            )
            self._search("parameters", "part of a name")
            self._parameters = gui.add_html("")

    def _build_commands(self) -> None:
        gui = self._server.gui
        if not self._link.commands:
            gui.add_markdown(
                "Read only: this page is served to other machines. `--allow-commands` lifts that."
            )
            return
        asked: tuple[tuple[str, int, tuple[float, ...]], ...] = (
            ("Arm", live_link.ARM, (1.0,)),
            ("Disarm", live_link.ARM, (0.0,)),
            ("Land", live_link.LAND, (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, _NAN)),
            ("Hold", live_link.HOLD, ()),
            ("Return", live_link.RETURN, ()),
            ("Fly the trajectory", live_link.SET_MODE, live_link.TRAJECTORY),
        )
        gui.add_button("Take off").on_click(lambda _: self._later(self._take_off))
        for name, command, params in asked:
            button = gui.add_button(name)
            button.on_click(self._asking(command, params))
        with gui.add_folder("End-effector"):
            self._drag: Any = gui.add_checkbox("drag its target", False)
            self._drag.on_update(lambda _: self._later(self._switch_gizmo))
        with gui.add_folder("Obstacle"):
            centre = gui.add_vector3("centre, NED [m]", (1.0, 0.0, -1.4), step=0.05)
            radius = gui.add_number("radius [m]", 0.1, min=0.01, max=5.0, step=0.01)
            gui.add_button("Add a ball").on_click(
                lambda _: self._later(lambda: self._announce(centre.value, radius.value))
            )

    def _search(self, what: str, hint: str) -> None:
        field = self._server.gui.add_text("search", "", hint=hint)
        field.on_update(lambda _: self._wanted.update({what: field.value.upper()}))

    def _asking(
        self, command: int, params: tuple[float, ...]
    ) -> Callable[[viser.GuiEvent[Any]], None]:
        return lambda _: self._later(lambda: self._ask(command, params))

    def _later(self, what: Callable[[], Any]) -> None:
        """Do it after what was asked for before: answers take time, and viser's threads are few."""
        with contextlib.suppress(RuntimeError):  # the page is being closed
            self._asked.submit(what)

    def _ask(self, command: int, params: tuple[float, ...]) -> bool:
        good, sentence = self._link.ask(command, params)
        self._answer.content = panels.refusal_html(sentence, good=good)
        return good

    def _take_off(self) -> None:
        """The command waits for the vehicle to be armed."""
        usual = (0.0, 0.0, 0.0, _NAN, _NAN, _NAN, _NAN)
        if self._ask(live_link.TAKE_OFF, usual) and not self._link.scene().armed:
            self._ask(live_link.ARM, (1.0,))

    def _switch_gizmo(self) -> None:
        if not self._drag.value:
            dragged = self._gizmo is not None
            self._end_dragging()
            if dragged:
                self._ask(live_link.HOLD, ())
            return
        now = self._link.scene()
        if now.estimate is None:
            self._drag.value = False
            return
        tip = tip_of(now.estimate, self._airframe)
        self._gizmo = self._server.scene.add_transform_controls(
            "/end-effector target", scale=0.35, disable_rotations=True, position=tip,
            depth_test=False,
        )  # fmt: skip
        self._gizmo.on_update(lambda _: self._aim())
        self._link.aim(tip)
        time.sleep(0.3)  # the vehicle changes to offboard only while setpoints come
        if not self._drag.value:
            self._end_dragging()  # it was cleared meanwhile
        elif not self._ask(live_link.SET_MODE, live_link.OFFBOARD):
            self._end_dragging()
            self._drag.value = False

    def _aim(self) -> None:
        gizmo = self._gizmo
        if gizmo is not None:
            x, y, z = (float(one) for one in gizmo.position)
            self._link.aim((x, y, z))

    def _end_dragging(self) -> None:
        self._link.aim(None)
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None

    def _announce(self, centre: tuple[float, float, float], radius: float) -> None:
        refusal = self._link.announce(centre, float(radius))
        announced = "obstacle announced; the vehicle says below events whether it keeps it"
        self._answer.content = panels.refusal_html(refusal or announced, good=refusal is None)

    def _run(self) -> None:
        while not self._ended.wait(_FRAME_S):
            scene = self._safely(self._link.scene)
            for step in (self._remember, self._draw, self._tell):
                if scene is not None:
                    self._safely(step, scene, time.monotonic())

    def _safely(self, step: Callable[..., Answer], *about: Any) -> Answer | None:
        """Do a step; with some numbers of a vehicle it may fail, and with the next ones not."""
        try:
            return step(*about)
        except Exception as error:
            self._say_undrawn(error)
            return None

    def _draw(self, scene: Scene, now_s: float) -> None:
        self._link.watched = bool(self._server.get_clients())
        if not self._link.watched:
            if self._gizmo is not None and self._drag.value:
                self._drag.value = False  # as if it was cleared
        elif scene.t != self._drawn_t or self._is_due("still", now_s, _STILL_S):
            self._drawn_t = scene.t
            self._frames += 1
            with self._server.atomic():
                self.stage.show(scene)

    def _tell(self, scene: Scene, now_s: float) -> None:
        if not self._link.watched:
            return
        if self._is_due("text", now_s, _TEXT_S):
            self._write(scene)
        if self._is_due("plot", now_s, _PLOT_S) and len(self._recent) > 1:
            curves = curves_of(list(self._recent), self._airframe)
            for plot, curve in zip(self._plots, curves, strict=True):
                plot.replace(curve)

    def _say_undrawn(self, error: Exception) -> None:
        """Say why a frame was not drawn; once, or the answers of the vehicle could not be read."""
        sentence = panels.undrawn(error)
        if sentence != self._undrawn:
            self._undrawn = sentence
            self._answer.content = panels.refusal_html(sentence, good=False)

    def _remember(self, scene: Scene, now_s: float) -> None:
        if scene.estimate is None or math.isnan(scene.t):
            return
        if not self._framed:
            self._frame(scene.estimate.p)
        if self._recent and scene.t < self._recent[-1].t:
            self._recent.clear()  # another flight
            self._trail.clear()
            self._piece = 0
            self.stage.drop_trail(_PIECES)
        if self._is_due("kept", now_s, _KEPT_S):
            self._recent.append(scene)
        if self._is_due("trail", now_s, _TRAIL_S):
            self._trail.append((tip_of(scene.estimate, self._airframe), scene.minimum))
            if len(self._trail) >= _PIECE:
                points, margins = zip(*self._trail, strict=True)
                trail = Trail(np.array(points), np.array(margins))
                self.stage.extend_trail(self._piece, trail, _PIECES)
                self._piece += 1
                self._trail = self._trail[-1:]

    def _frame(self, p: Vec3) -> None:
        """Look at where the vehicle was found."""
        self._framed = True
        low = (p[0] - _REACH, p[1] - _REACH, min(p[2], -1.5) - 1.0)
        self.stage.frame(self._server, (low, (p[0] + _REACH, p[1] + _REACH, 0.0)))

    def _write(self, scene: Scene) -> None:
        self._now.content = panels.now_html(scene, self._airframe, 0.0)
        events = self._link.read(lambda telemetry: tuple(telemetry.events))
        self._events.content = panels.events_html(events, math.inf, 0.0)
        now_s = time.monotonic()
        word, name = self._wanted["messages"], self._wanted["parameters"]
        heard = self._link.read(lambda telemetry: list(telemetry.heard.values()))
        rows = [
            (f"{o.system}/{o.component}", o.name, o.rate(now_s), o.fields() if word else "")
            for o in sorted(heard, key=lambda o: (o.system, o.component, o.name))
            if word in o.name
        ]
        self._messages.content = panels.messages_html(rows[:_FOUND])
        known = self._link.read(lambda telemetry: sorted(telemetry.parameters.items()))
        found = [(one, f"{value:g}") for one, value in known if name in one]
        self._parameters.content = panels.parameters_html(found[:_FOUND])

    def _is_due(self, what: str, now_s: float, every_s: float) -> bool:
        if now_s - self._due[what] < every_s:
            return False
        self._due[what] = now_s
        return True
