"""`fpsolve explore`: what its page asks and is told, whom its server answers, and the page in a real browser."""

import errno
import http.client
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import tomllib
from contextlib import ExitStack, contextmanager
from pathlib import Path
from socketserver import TCPServer
from statistics import median
from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import explore, lyapunov_exponent
from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.page.local import LocalPage
from fpsolve.parts.indices import index_text, told_indices
from fpsolve.parts.part import Numerics
from fpsolve.study.solve import everything, solve_curve
from fpsolve.workflow.explore import Explorer

CASES = Path(__file__).parents[1] / "cases"
INSTALL = "apt-get install -y --no-install-recommends chromium"
IS_REQUIRED = bool(os.environ.get("FPSOLVE_REQUIRE_CHROMIUM"))


def values_of(explorer, **changed):
    knobs = explorer.answer("start", {"page": "a", "number": 1})["knobs"]
    return {knob["key"]: knob["value"] for knob in knobs} | {key.replace("__", "."): v for key, v in changed.items()}


def question(explorer, number=2, page="a", **changed):
    return {"page": page, "number": number, "values": values_of(explorer, **changed)}


def explorer_of(name):
    return Explorer(load_case(CASES / f"{name}.toml"), "problem")


def cells(html):
    """The cells of all tables, row by row."""
    return [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)]


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("fig1", {"noise__D0": 0.7, "oscillator__c1": -0.05}),
        ("theorem", {"oscillator__omega": 1.3}),
        ("systems/beam", {"noise__alpha": 2.0}),
        ("systems/telegraph", {"system__damping": 0.2}),
    ],
)
def test_a_saved_case_gives_the_numbers_of_the_page(tmp_path, name, changed):
    explorer = explorer_of(name)
    found = explorer.answer("solve", question(explorer, **changed))
    saved = explorer.answer("save", question(explorer, **changed))
    path = (CASES / name).parent / saved["name"]  # not written there: what it names is beside it
    for each in (CASES / name).parent.iterdir():
        (tmp_path / each.name).symlink_to(each)
    (tmp_path / path.name).write_text(saved["text"], encoding="utf-8")
    case = load_case(tmp_path / path.name)
    assert case.planned == 1
    result = solve_curve(next(case.curves()), everything(case), Numerics.of(case)).result
    assert found["curve"][1] == result.moments.value.tolist()
    rows = {row[1]: row[2] for row in cells(found["numbers"])[1:] if len(row) > 2}
    rows.pop("Λ(2)", None)
    assert rows == {index.symbol: index_text(index, result) for index in told_indices(case)}
    comments = re.findall("#.*", (CASES / f"{name}.toml").read_text(encoding="utf-8"))
    assert comments[0] in saved["text"]


def test_python_gives_the_problem_of_the_page():
    explorer = Explorer(load_case(CASES / "fig1.toml"), f"load_case({str(CASES / 'fig1.toml')!r}).problem")
    text = explorer.answer("python", question(explorer, noise__D0=0.7))["text"]
    names = {}
    exec(text.replace("print", ""), names)  # which is ours
    found = explorer.answer("solve", question(explorer, noise__D0=0.7))
    assert names["problem"].values["noise.D0"] == 0.7
    exponent = names["lyapunov_exponent"](names["problem"], rtol=1e-8)
    assert abs(exponent.value - found["exponent"]) <= 2 * exponent.error_estimate


@pytest.mark.slow
def test_while_a_slider_moves_numbers_are_within_their_error():
    for name, changes in (
        ("fig1", (1.0, 1.1, 0.2)),
        ("strong", (0.5, 0.55, 0.05)),
        ("systems/white_noise", (1.0, 1.15)),
    ):
        explorer = explorer_of(name)
        key = next(key for key in values_of(explorer) if key.startswith("noise.")).replace(".", "__")
        for change in changes:  # the second one begins with what was found for the first one
            moving = explorer.answer("move", question(explorer, **{key: change}))
        settled = explorer.answer("solve", question(explorer, **{key: changes[-1]}))
        at_rest = {p: (value, error) for p, value, _, error in zip(*settled["curve"], strict=True)}
        assert {0.0, 2.0} <= {*moving["curve"][0]} < {*at_rest}
        for p, value, _, error in zip(*moving["curve"], strict=True):
            assert abs(value - at_rest[p][0]) <= error + at_rest[p][1]
        assert [row[:2] for row in cells(moving["numbers"])] == [row[:2] for row in cells(settled["numbers"])]


def test_a_map_shows_the_rows_of_its_grid_as_they_come_and_is_stopped_between_them(monkeypatch):
    explorer, told = explorer_of("systems/telegraph"), []
    axes = [{"key": key, "start": 0.05, "stop": 1.0} for key in ("system.damping", "noise.a")]

    def look(asked, number):
        told.append(explorer.answer("listen", {"page": "a", "number": 3}))
        if len(told) > 30 and any("map" in each for each in told):
            raise KeyboardInterrupt

    monkeypatch.setattr(explorer, "_look", look)
    assert explorer.answer("map", {**question(explorer), "axes": axes}) == {"stopped": True}
    assert any("unknowns" in each.get("waits", "") for each in told)
    grid = next(each["map"]["grid"] for each in told if "map" in each)
    assert len(grid) == 13
    problem = explorer.first
    for k in (0, 6, 12):  # dark below 0
        there = problem.at({"system.damping": 0.05, "noise.a": 0.05 + k * 0.95 / 12})
        assert grid[0][k] == np.sign(lyapunov_exponent(there).value)


@pytest.mark.parametrize(
    ("name", "changed", "words"),
    [
        ("fig1", {"noise__D0": -1.0}, r"^D0: got -1.0; must be .*>= .*noise intensity.*; write, for example"),
        ("fig1", {"noise__D0": ""}, r'^D0: got "" .*must be a finite number'),
        ("fig1", {"noise__D0": float("nan")}, "^D0: got nan; must be "),
        ("systems/own_equation", {"system__zeta": "abc"}, r"zeta: got 'abc'; must be a finite number"),
        ("fig1", {"nothing": 1.0}, "must be values by their keys, which are noise.D0, "),
        ("fig1", {"oscillator__epsilon": 900.0, "oscillator__restitution": 0.01}, "overflow"),
    ],
)
def test_bad_values_are_refused_with_the_sentences_of_cases(name, changed, words):
    explorer = explorer_of(name)
    for each in ("move", "solve", "save", "python"):
        told = explorer.answer(each, question(explorer, **changed))
        assert re.search(words, told["refused"]), told


@pytest.mark.slow
def test_a_newer_question_of_a_page_ends_an_older_one():
    explorer, told = explorer_of("strong"), {}
    started = threading.Event()

    def ask():
        started.set()
        told["old"] = explorer.answer("solve", question(explorer, 2))

    explorer._solved(explorer.case, is_moving=True)  # imports are done
    thread = threading.Thread(target=ask)
    thread.start()
    started.wait()
    while ("a", "curve") not in explorer._newest:
        pass
    told["other page"] = explorer.answer("move", question(explorer, 9, page="b"))
    assert "curve" in told["other page"]
    explorer.answer("stop", {"page": "a", "number": 3, "of": "curve"})
    thread.join()
    assert told["old"] == {"stopped": True}


def test_pictures_are_of_the_eigenfunction_and_of_a_density():
    for name in ("fig1", "systems/own_equation"):
        explorer = explorer_of(name)
        found = explorer.answer("field", {**question(explorer), "p": 0.0})["panels"]
        values = np.array(found[-1]["values"])
        sides = [np.linspace(*ends, count) for ends, count in zip(found[-1]["ends"], values.shape, strict=True)]
        assert abs(np.trapezoid(np.trapezoid(values, sides[1]), sides[0]) - 1) < 2e-3
        np.testing.assert_allclose(found[0]["values"], 1, atol=1e-4)  # T = 1 at p = 0
    for p in ("two", 10**400):
        assert f"got p = {p!r}" in explorer.answer("field", {**question(explorer), "p": p})["refused"]


def test_a_map_of_no_frame_is_refused():
    explorer = explorer_of("fig1")
    side = {"key": "noise.D0", "start": 0.1, "stop": 1.0, "scale": "log"}
    for axes, words in (
        ([side, side], "both axes"),
        ([side, {"key": "noise.D0"}], "missing"),
        ([side, {**side, "key": "none"}], "got none as an axis"),
        (None, "x"),
    ):
        assert words in explorer.answer("map", {**question(explorer), "axes": axes})["refused"]


def test_sliders_go_as_far_as_the_case_or_the_parameter_says():
    def ends(name):
        knobs = explorer_of(name).answer("start", {"page": "a", "number": 1})["knobs"]
        return {knob["key"]: (*knob["ends"], knob["log"]) for knob in knobs}

    fig1, charted = ends("fig1"), ends("chart")
    assert fig1["noise.D0"] == (0.1, 1.0, True)  # as it varies
    assert fig1["oscillator.restitution"][1:] == (1.0, False)
    assert 0 < fig1["oscillator.restitution"][0] < 0.05
    assert fig1["oscillator.omega"] == (0.1, 10.0, True)
    assert charted["oscillator.omega"] == (0.3, 5.0, True)
    assert ends("systems/noisy_damping")["system.c"][2] in (True, False)


@contextmanager
def served(explorer):
    page = LocalPage(explorer.answer)
    threading.Thread(target=page.serve_forever, daemon=True).start()
    try:
        yield page
    finally:
        page.shutdown()
        page.server_close()


@pytest.mark.slow
def test_only_the_own_page_of_this_machine_is_answered():
    explorer = explorer_of("fig1")
    with served(explorer) as page:
        assert page.server_address[0] == "127.0.0.1"

        def status(method, path, body=None, **headers):
            connection = http.client.HTTPConnection(*page.server_address)
            own = {"Host": page.host, "Origin": page.address, "Content-Type": "application/json"}
            headers = own | {name.replace("_", "-"): value for name, value in headers.items()}
            connection.request(method, path, body, {key: value for key, value in headers.items() if value})
            response = connection.getresponse()
            text = response.read().decode()
            connection.close()
            return response.status, text, response.headers

        good = json.dumps({"page": "a", "number": 1})
        code, text, headers = status("GET", "/", Origin=None)
        assert code == 200
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert not re.search(r"https?:", text)
        assert "fig1.toml" in status("POST", "/start", good)[1]
        assert str(CASES.parent) not in status("POST", "/start", good)[1]
        for changed in (
            {"Host": "evil.example"},
            {"Host": f"evil.example:{page.server_port}"},
            {"Origin": "http://evil.example"},
            {"Origin": "null"},
            {"Origin": None},
            {"Content_Type": "text/plain"},
        ):
            assert status("POST", "/start", good, **changed)[0] == 403
        for origin in (page.address, "http://evil.example"):
            assert status("POST", "/start", Origin=origin, Content_Length="1" * 5000)[0] == 403
        assert status("GET", "/", Host="evil.example")[0] == 403
        for path in ("/../pyproject.toml", "/etc/passwd", "/fpsolve"):
            assert status("GET", path)[0] == 403
        for body in ("", "[]", "{", "[" * 90_000, "1" * 200_000):
            assert status("POST", "/start", body)[0] == 403
        assert "refused" in status("POST", "/start", json.dumps({"page": "a"}))[1]


@pytest.mark.slow
def test_work_ends_with_its_connection_and_files_that_run_out_are_waited_for(monkeypatch):
    ended, tries = threading.Event(), []

    def answer(name, question, is_gone):
        while not is_gone():
            time.sleep(0.01)
        ended.set()
        return {}

    def refuse(_):
        tries.append(1)
        raise OSError(errno.EMFILE, "Too many open files")

    with served(SimpleNamespace(answer=answer)) as page:
        connection = http.client.HTTPConnection(*page.server_address)
        own = {"Host": page.host, "Origin": page.address, "Content-Type": "application/json"}
        connection.request("POST", "/solve", "{}", own)
        assert not ended.wait(0.3)
        connection.close()
        assert ended.wait(10)
        monkeypatch.setattr(TCPServer, "get_request", refuse)
        with socket.create_connection(page.server_address):
            time.sleep(0.5)
        assert 0 < len(tries) < 8
    explorer = explorer_of("fig1")
    assert explorer.answer("solve", question(explorer), lambda: True) == {"stopped": True}


@pytest.mark.slow
def test_a_notebook_shows_the_page_of_a_problem():
    problem = load_case(CASES / "theorem.toml").problem
    shown = explore(problem)
    try:
        assert f'<iframe src="{shown.address}"' in shown._repr_html_()
        knobs = shown._page.answer("start", {"page": "a", "number": 1})
        assert knobs["file"] == ""
        assert {knob["key"] for knob in knobs["knobs"]} == {*problem.differentiable}
        found = shown._page.answer("solve", {"page": "a", "number": 2, "values": {"oscillator.c1": 0.05}})
        other = lyapunov_exponent(problem.at({"oscillator.c1": 0.05}))
        assert abs(found["exponent"] - other.value) <= 2 * other.error_estimate
        code = shown._page.answer("python", {"page": "a", "number": 2, "values": {"oscillator.c1": 0.05}})["text"]
        assert "problem = problem.at({'oscillator.c1': 0.05})" in code
    finally:
        shown.close()
    with pytest.raises(TypeError, match="must be a Problem"):
        explore(problem.system)


@pytest.fixture(scope="module")
def browser():
    """Chromium of the system, without a window."""
    where = shutil.which("chromium")
    if where is None:
        message = f"the browser is missing: {INSTALL}"
        if IS_REQUIRED:
            pytest.fail(message)
        pytest.skip(message)
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
    until(page, "document.querySelector('#state').textContent.endsWith('s')")
    yield page
    assert not faults
    context.close()


@contextmanager
def explored(browser, name, *overrides, **options):
    """A page of a case."""
    explorer = Explorer(load_case(CASES / f"{name}.toml", overrides), "problem")
    with served(explorer) as server, opened(browser, server.address, **options) as page:
        yield page


def at_rest(page):
    until(page, "/^[0-9.]+ m?s$/.test(document.querySelector('#state').textContent)")


def turn(page, key, value):
    """Type a value."""
    before = page.evaluate("wanted")
    page.fill(f"[id='knob-{key}']", value)
    page.keyboard.press("Tab")
    until(page, f"wanted > {before}")
    at_rest(page)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("systems/beam", "noise.alpha", "1.5"),
        ("systems/hoisted", "noise.s", "0.03"),
    ],
)
def test_at_rest_the_page_has_the_numbers_of_run(browser, tmp_path, name, key, value):
    with explored(browser, name, "moments.rtol=1e-4") as page:
        turn(page, key, value)
        shown, page_table = cells(page.inner_html("#numbers")), page.inner_html("#table")
        with page.expect_download() as download:
            page.click("#save")
        for each in (CASES / name).parent.iterdir():
            (tmp_path / each.name).symlink_to(each)
        saved = tmp_path / download.value.suggested_filename
        download.value.save_as(saved)
    data = tomllib.loads(saved.read_text(encoding="utf-8"))
    assert float(value) == pytest.approx(Explorer(load_case(saved), "").first.values[key])
    assert "vary" not in data
    assert main(["run", str(saved), "--out", str(tmp_path / "out"), "--report"]) == 0
    report = cells((tmp_path / "out" / saved.stem / "report.html").read_text(encoding="utf-8"))
    rows = [row for row in shown if len(row) > 3] or cells(page_table)
    assert rows
    assert all(row[:3] in [each[:3] for each in report] for row in rows)  # others tell of uncertain parameters


@pytest.mark.slow
def test_bad_input_reset_and_the_end_of_the_server(browser):
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
        assert page.locator("#curve path.one").count()  # the last valid curve stays
        page.click("#reset")
        at_rest(page)
        assert page.inner_text("#refused") == ""
        assert page.inner_html("#numbers") == first
        other = page.context.new_page()
        other.goto(page.url)
        until(other, "document.querySelector('#state').textContent.endsWith('s')")
        turn(other, "noise.D0", "0.9")
        assert page.inner_html("#numbers") == first
        other.close()
        process.kill()
        until(page, "document.querySelector('#refused').textContent.startsWith('fpsolve has ended')")
        assert all("ERR_CONNECTION" in each for each in page.faults)
        page.faults.clear()


@pytest.mark.slow
def test_the_page_can_be_used_by_everyone(browser):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with explored(browser, "fig1") as page:
        for width, scheme in ((400, "light"), (1280, "dark")):
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
def test_a_click_on_the_map_sets_the_sliders_and_paths_grow_with_the_exponent(browser):
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


MOVES = """
async count => {
  const slider = document.querySelectorAll("input[type=range]")[2], svg = document.querySelector("#curve svg");
  const path = () => svg.querySelector("path.one.line")?.getAttribute("d");
  const times = [];
  for (let k = 0; k < count; k++) {
    const before = path(), start = performance.now();
    slider.value = 200 + 10 * k;
    slider.dispatchEvent(new Event("input"));
    await new Promise(done => new MutationObserver((_, watch) => {
      if (path() && path() !== before) { watch.disconnect(); done(); }
    }).observe(svg, {childList: true, subtree: true}));
    await new Promise(requestAnimationFrame);
    times.push(performance.now() - start);
    while (isMoving) await new Promise(done => setTimeout(done, 1));
  }
  return times;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "most", "count"), [("fig1", 500, 9), ("strong", 2000, 3)])
def test_a_curve_follows_a_slider_at_once(browser, name, most, count):
    with explored(browser, name) as page:
        times = page.evaluate(MOVES, count)
    print(f"slider to curve: {name} {median(times):.0f} ms, at most {max(times):.0f} ms")
    assert median(times) < most  # a tenth of it where nothing else runs
