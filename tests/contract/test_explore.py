"""`fpsolve explore`: what its page asks and is told, whom its server answers, and the page in a real browser."""

import http.client
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

import fpsolve
from fpsolve import explore, load_case, lyapunov_exponent
from tests.kit import run

CASES = Path(__file__).parents[2] / "cases"
INSTALL = "apt-get install -y --no-install-recommends chromium"


class Page:
    """What the page of a case sends to its server."""

    def __init__(self, shown, name="a"):
        self.shown, self.host, self.name = shown, shown.address.removeprefix("http://"), name
        self.knobs = {each["key"]: each for each in self.ask("start")["knobs"]}

    def asked(self, method, path, body=None, **headers):
        """A connection on which an answer will come."""
        connection = http.client.HTTPConnection(self.host)
        headers = {"Host": self.host, "Origin": self.shown.address, "Content-Type": "application/json"} | headers
        connection.request(method, path, body, {key: value for key, value in headers.items() if value})
        return connection

    def sent(self, *question, **headers):
        """The code of the answer, its text and its headers."""
        connection = self.asked(*question, **headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, text, answer.headers

    def ask(self, name, number=1, **more):
        return json.loads(self.sent("POST", f"/{name}", json.dumps({"page": self.name, "number": number, **more}))[1])

    def told(self, name, changed, number=2, **more):
        """The answer to a question with these values of sliders, beside those of the case."""
        return self.ask(name, number, values=self.values() | changed, **more)

    def values(self):
        return {key: knob["value"] for key, knob in self.knobs.items()}


@contextmanager
def page_of(name):
    shown = explore(CASES / f"{name}.toml" if isinstance(name, str) else name)
    try:
        yield Page(shown)
    finally:
        shown.close()


@pytest.fixture(scope="module")
def fig1():
    with page_of("fig1") as page:
        yield page


def cells(html):
    """The cells of all tables, row by row."""
    return [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)]


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("fig1", {"noise.D0": 0.7, "oscillator.c1": -0.05}),
        ("systems/beam", {"noise.alpha": 2.0}),
        ("systems/telegraph", {"system.damping": 0.2}),
    ],
)
def test_case_saved_from_the_page_gives_its_numbers_in_a_run(tmp_path, name, changed):
    with page_of(name) as page:
        found, saved = (page.told(each, changed) for each in ("solve", "save"))
    for each in (CASES / name).parent.iterdir():  # what it names is beside it
        (tmp_path / each.name).symlink_to(each)
    (tmp_path / saved["name"]).write_text(saved["text"], encoding="utf-8")
    [result] = fpsolve.run(tmp_path / saved["name"], tmp_path / "out")
    assert found["curve"][1] == result.moments.value.tolist()
    assert found["exponent"] == (result.lyapunov_exponent and result.lyapunov_exponent.value)
    assert re.search("#.*", (CASES / f"{name}.toml").read_text(encoding="utf-8"))[0] in saved["text"]


def test_python_of_the_page_gives_its_numbers(fig1, monkeypatch):
    text, names = fig1.told("python", {"noise.D0": 0.7})["text"], {}
    monkeypatch.chdir(CASES)
    exec(text.replace("print", ""), names)  # which is ours
    assert names["problem"].values["noise.D0"] == 0.7
    exponent = names["lyapunov_exponent"](names["problem"], rtol=1e-8)
    assert abs(exponent.value - fig1.told("solve", {"noise.D0": 0.7})["exponent"]) <= 2 * exponent.error_estimate


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes"),
    [("fig1", (1.0, 1.1, 0.2)), ("strong", (0.5, 0.55, 0.05)), ("systems/white_noise", (1.0, 1.15))],
)
def test_numbers_are_within_their_error_while_a_slider_moves(name, changes):
    """The second position begins with what was found for the first one."""
    with page_of(name) as page:
        key = next(key for key in page.knobs if key.startswith("noise."))
        moving = [page.told("move", {key: change}) for change in changes][-1]
        settled = page.told("solve", {key: changes[-1]})
    at_rest = {p: (value, error) for p, value, _, error in zip(*settled["curve"], strict=True)}
    assert {0.0, 2.0} <= {*moving["curve"][0]} < {*at_rest}
    for p, value, _, error in zip(*moving["curve"], strict=True):
        assert abs(value - at_rest[p][0]) <= error + at_rest[p][1]
    assert [row[:2] for row in cells(moving["numbers"])] == [row[:2] for row in cells(settled["numbers"])]


@pytest.mark.parametrize("name", [pytest.param("strong", marks=pytest.mark.slow), "systems/telegraph"])
def test_map_shows_its_grid_as_it_comes_and_ends_where_the_page_asks_for_that(name):
    with page_of(name) as page, ThreadPoolExecutor() as pool:
        axes = [{"key": key, "start": 0.05, "stop": 1.0} for key in [*page.knobs][-2:]]
        asked = pool.submit(page.told, "map", {}, axes=axes)
        heard = [page.ask("listen", 3)]
        while "map" not in heard[-1] and not asked.done():
            heard.append(page.ask("listen", 3))
        assert any("unknowns" in each.get("waits", "") for each in heard)
        assert page.ask("stop", 3).keys() <= {"seconds"}
        assert asked.result() == {"stopped": True}


@pytest.mark.parametrize(
    ("name", "kind", "is_told"),
    [
        ("systems/telegraph", "map", False),
        ("systems/coupled_ou", "solve", False),
        ("systems/coupled_ou", "solve", True),
    ],
)
def test_page_that_is_closed_ends_what_it_waits_for(name, kind, is_told):
    """By what it sends when it is closed, or as its connection is."""
    with page_of(name) as page:
        before, axes = threading.active_count(), [{"key": key, "start": 0.1, "stop": 1} for key in [*page.knobs][-2:]]
        question = {"page": page.name, "number": 1, "values": page.values(), "axes": axes}
        connection = page.asked("POST", f"/{kind}", json.dumps(question))
        while "waits" not in page.ask("listen", 2):
            time.sleep(0.01)
        if is_told:
            page.ask("stop", 3)
            assert json.loads(connection.getresponse().read()) == {"stopped": True}
        connection.close()
        for _ in range(1000):
            time.sleep(0.02 * (threading.active_count() > before))
        assert threading.active_count() <= before


SIDE = {"key": "noise.D0", "start": 0.1, "stop": 1.0, "scale": "log"}
REFUSED = [
    # values, question, what is said
    ({"noise.D0": -1.0}, {}, r"^D0: got -1.0; must be .*>= .*noise intensity.*; write, for example"),
    ({"noise.D0": ""}, {}, r'^D0: got ""; must be a finite number'),
    ({"noise.D0": float("nan")}, {}, "^D0: got nan; must be "),
    ({"nothing": 1.0}, {}, "must be values by their keys, which are noise.D0, "),
    ({"oscillator.epsilon": 900.0, "oscillator.restitution": 0.01}, {}, "overflow"),
    ({}, {"axes": [SIDE, SIDE]}, "both axes"),
    ({}, {"axes": [SIDE, {"key": "noise.D0"}]}, "missing"),
    ({}, {"axes": [SIDE, {**SIDE, "key": "none"}]}, 'y.key: got "none"; must be one of'),
    ({}, {"axes": None}, "x"),
    ({}, {"p": "two"}, "got p = 'two'"),
    ({}, {"p": 10**400}, "got p = 1000"),
    ({}, {"number": None}, "got None as the number of a question"),
]


@pytest.mark.parametrize(("changed", "question", "said"), REFUSED)
def test_bad_question_is_refused_with_the_sentences_of_cases(fig1, changed, question, said):
    kinds = ["map"] if "axes" in question else ["field"] if "p" in question else ["move", "solve", "save", "python"]
    for kind in kinds:
        assert re.search(said, fig1.told(kind, changed, **question)["refused"])


def test_newer_question_of_a_page_ends_an_older_one_and_none_of_another_page(fig1):
    own, other = (Page(fig1.shown, name) for name in "bc")
    own.ask("stop", 10)
    assert own.told("solve", {}, 9) == {"stopped": True}
    assert "curve" in other.told("move", {})


@pytest.mark.parametrize("name", ["fig1", "systems/own_equation"])
def test_pictures_are_of_an_eigenfunction_and_of_a_density(name):
    """T = 1 at p = 0."""
    with page_of(name) as page:
        found = page.told("field", {}, p=0.0)["panels"]
    values = np.array(found[-1]["values"])
    sides = [np.linspace(*ends, count) for ends, count in zip(found[-1]["ends"], values.shape, strict=True)]
    assert abs(np.trapezoid(np.trapezoid(values, sides[1]), sides[0]) - 1) < 2e-3
    np.testing.assert_allclose(found[0]["values"], 1, atol=1e-4)


def test_sliders_go_as_far_as_the_case_or_the_parameter_says(fig1):
    ends = {key: (*knob["ends"], knob["log"]) for key, knob in fig1.knobs.items()}
    assert ends["noise.D0"] == (0.1, 1.0, True)  # as it varies
    assert 0 < ends["oscillator.restitution"][0] < 0.05
    assert ends["oscillator.restitution"][1:] == (1.0, False)
    assert ends["oscillator.omega"] == (0.1, 10.0, True)
    with page_of("chart") as page:
        assert page.knobs["oscillator.omega"]["ends"] == [0.3, 5.0]
        assert page.ask("start")["axes"] == ["oscillator.omega", "noise.D0"]


def test_pictures_name_the_unit_of_time_of_the_case():
    with page_of(load_case(CASES / "fig1.toml", ["units.time='s'"])) as page:
        assert page.ask("start")["time"] == "time (s)"
        field, paths = page.told("field", {}, p=1.0)["panels"][1], page.told("paths", {})["told"]
    assert (field["names"][1], field["title"]) == ("noise ξ (1/s)", "stationary density (s/rad)")
    assert "ln‖x‖/t (1/s)" in paths


GOOD = json.dumps({"page": "a", "number": 1})
HOSTILE = [
    *[("POST", "/start", GOOD, {"Host": host}) for host in ("evil.example", "evil.example:80")],
    *[("POST", "/start", GOOD, {"Origin": origin}) for origin in ("http://evil.example", "null", None)],
    ("POST", "/start", GOOD, {"Content-Type": "text/plain"}),
    ("POST", "/start", None, {"Content-Length": "1" * 5000}),
    ("POST", "/start", None, {"Content-Length": "1" * 5000, "Origin": "http://evil.example"}),
    *[("POST", "/start", body, {}) for body in ("", "[]", "{", "[" * 90_000, "1" * 200_000)],
    ("GET", "/", None, {"Host": "evil.example"}),
    *[("GET", path, None, {}) for path in ("/../pyproject.toml", "/etc/passwd", "/fpsolve")],
]


@pytest.mark.parametrize(("method", "path", "body", "headers"), HOSTILE)
def test_request_from_elsewhere_is_refused(fig1, method, path, body, headers):
    assert fig1.sent(method, path, body, **headers)[:2] == (403, "refused")


def test_page_is_served_to_this_machine_alone_and_names_no_other(fig1):
    code, text, headers = fig1.sent("GET", "/", Origin=None)
    assert (code, fig1.host.partition(":")[0]) == (200, "127.0.0.1")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert not re.search(r"https?:", text)
    start = fig1.sent("POST", "/start", GOOD)[1]
    assert "fig1.toml" in start
    assert str(CASES.parent) not in start


def test_notebook_shows_the_page_of_a_problem():
    problem = load_case(CASES / "theorem.toml").problem
    with page_of(problem) as page:
        assert f'<iframe src="{page.shown.address}"' in page.shown._repr_html_()
        assert page.ask("start")["file"] == ""
        assert page.knobs.keys() == {*problem.differentiable}
        other, change = lyapunov_exponent(problem.at({"oscillator.c1": 0.05})), {"oscillator.c1": 0.05}
        found = page.ask("solve", 2, values=change)["exponent"]
        assert abs(found - other.value) <= 2 * other.error_estimate
        assert "problem = problem.at({'oscillator.c1': 0.05})" in page.ask("python", 2, values=change)["text"]
    with pytest.raises(TypeError, match="must be a Problem"):
        explore(problem.system)


@pytest.fixture(scope="module")
def browser():
    """Chromium of the system, without a window."""
    where = shutil.which("chromium")
    if where is None:
        end = pytest.fail if os.environ.get("FPSOLVE_REQUIRE_CHROMIUM") else pytest.skip
        end(f"the browser is missing: {INSTALL}")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as made, made.chromium.launch(executable_path=where, args=["--no-sandbox"]) as chromium:
        yield chromium


def until(page, what):
    """Wait for what JavaScript says; Playwright's own wait needs eval, which the page does not let run."""
    for _ in range(600):
        if page.evaluate(what):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"never {what}: {page.inner_text('body')}")


def at_rest(page):
    until(page, "/^[0-9.]+ m?s$/.test(document.querySelector('#state').textContent)")


@contextmanager
def opened(browser, address, **options):
    """A page of a server; what its console or its network says is a failure."""
    context, faults = browser.new_context(**options), []
    page = context.new_page()
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    own = address, "data:", "blob:"
    page.on("request", lambda sent: None if sent.url.startswith(own) else faults.append(sent.url))
    page.goto(address)
    page.faults = faults
    at_rest(page)
    yield page
    assert not faults
    context.close()


@contextmanager
def explored(browser, name):
    with page_of(name) as server, opened(browser, server.shown.address) as page:
        yield page


def turn(page, key, value):
    """Type a value."""
    before = page.evaluate("wanted")
    page.fill(f"[id='knob-{key}']", value)
    page.keyboard.press("Tab")
    until(page, f"wanted > {before}")
    at_rest(page)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "key", "value"), [("systems/beam", "noise.alpha", "1.5"), ("systems/hoisted", "noise.s", "0.03")]
)
def test_page_at_rest_has_the_numbers_of_a_run(browser, tmp_path, name, key, value):
    with explored(browser, name) as page:
        turn(page, key, value)
        shown, page_table = cells(page.inner_html("#numbers")), page.inner_html("#table")
        with page.expect_download() as download:
            page.click("#save")
        for each in (CASES / name).parent.iterdir():
            (tmp_path / each.name).symlink_to(each)
        saved = tmp_path / download.value.suggested_filename
        download.value.save_as(saved)
    assert load_case(saved).problem.values[key] == pytest.approx(float(value))
    assert run(tmp_path, "run", saved.name, "--report").code == 0
    report = cells((tmp_path / "results" / saved.stem / "report.html").read_text(encoding="utf-8"))
    numbers = [row for row in shown if len(row) > 3] or cells(page_table)
    assert numbers
    assert [row for row in numbers if row[:3] not in [each[:3] for each in report]] == []  # the fourth is of others


@pytest.mark.slow
def test_page_keeps_its_last_curve_over_bad_input_and_says_that_its_server_has_ended(browser):
    command = [sys.executable, "-m", "fpsolve", "explore", str(CASES / "fig1.toml"), "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process, ExitStack() as ends:
        ends.callback(process.kill)
        address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())[0]
        page = ends.enter_context(opened(browser, address))
        first = page.inner_html("#numbers")
        page.fill("[id='knob-noise.D0']", "-1")
        page.keyboard.press("Tab")
        until(page, "document.querySelector('#refused').textContent.includes('D0: got -1; must be')")
        assert "stale" in page.get_attribute("body", "class")
        assert page.locator("#curve path.one").count()
        page.click("#reset")
        at_rest(page)
        assert page.inner_text("#refused") == ""
        assert page.inner_html("#numbers") == first
        process.kill()
        until(page, "document.querySelector('#refused').textContent.startsWith('fpsolve has ended')")
        assert all("ERR_CONNECTION" in each for each in page.faults)
        page.faults.clear()


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), [(400, "dark")])
def test_page_can_be_used_by_everyone(browser, width, scheme):
    """By the rules of axe."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with explored(browser, "fig1") as page:
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme)
        for tab in page.locator("#views label").all():
            tab.click()
            found = axe.run(page).response["violations"]
            assert not [(each["id"], each["nodes"][0]["html"]) for each in found]
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        for slider in page.locator("input[type=range]").all():
            name = slider.get_attribute("aria-label").removesuffix(", slider")
            assert page.get_by_label(re.compile("^" + re.escape(name))).count() >= 1


@pytest.mark.slow
def test_click_on_the_map_sets_the_sliders_and_paths_grow_with_the_exponent(browser):
    with explored(browser, "fig1") as page:
        page.click("[for=see-map]")
        page.select_option("#map select >> nth=0", "oscillator.c1")
        page.click("#map .go")
        until(page, "views.map !== undefined && $('stop').disabled")  # before it is done, it has what there is so far
        [line] = [each for each in page.evaluate("views.map.answer.lines") if each["name"] == "λ = 0"]
        (x, y), *_ = line["branches"]
        problem = load_case(CASES / "fig1.toml").problem
        for k in (0, len(x) // 2):
            there = problem.at({"oscillator.c1": x[k], "noise.D0": y[k]})
            assert abs(lyapunov_exponent(there).value) < 1e-6
        box = page.locator("#map svg").bounding_box()
        page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 0.4 * box["height"])
        at_rest(page)
        circle = page.locator("#map circle").bounding_box()
        assert abs(circle["x"] + circle["width"] / 2 - box["x"] - 0.6 * box["width"]) < 3
        assert float(page.input_value("[id='knob-noise.D0']")) != problem.values["noise.D0"]
        for name in ("field", "paths"):
            page.click(f"[for=see-{name}]")
            page.click(f"#{name} .go")
            until(page, f"views.{name} !== undefined")
            assert page.locator(f"#{name} svg").count() == 2
            assert page.locator(f"#{name} td").count() > 9
        found = page.evaluate("views.paths.answer")
    rates = np.array(found["logs"])[:, -1] / found["time"][-1]
    assert abs(np.mean(rates) - found["exponent"]) < 5 * np.std(rates) / 3
    assert len(found["logs"]) == 10
    assert min(found["motion"]) >= 0  # the wall is at 0
