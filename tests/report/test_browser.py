"""The page in a real browser: drawn, readable on a phone and a desk, quiet, and usable with the keyboard."""

import itertools
import os
import re
import shutil

import pytest

from omnieval.palette import contrast
from omnieval.report.write import write_report

pytestmark = pytest.mark.browser

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
WIDTHS = (390, 1440)
# Text whose colour or ground has no single value is not compared: in figures, and where it is hidden on purpose.
TEXTS = """
() => {
  const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
  const ground = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const color = rgb(getComputedStyle(one).backgroundColor);
      if (color.length < 4 || color[3] === 1) return color.slice(0, 3);
    }
    return null;
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = [];
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || element.closest("svg")) continue;
    found.push([rgb(getComputedStyle(element).color).slice(0, 3), ground(element), walker.currentNode.data.trim()]);
  }
  return found;
}
"""
LABELS = """
() => [...document.querySelectorAll("svg text")].map((text) => {
  const style = getComputedStyle(text), matrix = text.getScreenCTM();
  return [style.fill, style.stroke, text.textContent, parseFloat(style.fontSize) * Math.hypot(matrix.a, matrix.b)];
})
"""


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    path = os.environ.get("OMNIEVAL_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    assert path, f"browser tests need one of {', '.join(BROWSERS)}, or OMNIEVAL_BROWSER with its path"
    with sync_playwright() as playwright:
        # Without its sandbox, which a container's root cannot have; the page is our own and asks for nothing.
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def report(run, sweep, baseline, tmp_path_factory):
    return write_report([sweep, run, baseline], out=tmp_path_factory.mktemp("seen") / "report")


@pytest.fixture
def look(browser, report):
    """Open the page; returns it, what it said and what it asked for."""
    contexts = []

    def opened(width=1440, **options):
        context = browser.new_context(viewport={"width": width, "height": 900}, **options)
        contexts.append(context)
        page = context.new_page()
        said, asked = [], []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(report.page.as_uri())
        return page, said, asked

    yield opened
    for context in contexts:
        context.close()


def count_figures(report):
    return sum(name.endswith(".svg") for name in report.files)


@pytest.mark.parametrize("width", WIDTHS)
def test_no_error_and_no_request_besides_the_page_itself(look, report, width):
    page, said, asked = look(width)
    page.wait_for_load_state("networkidle")
    assert said == []
    assert asked == [report.page.as_uri()]


def test_the_page_needs_no_scripts(look, report):
    page, said, _ = look(java_script_enabled=False)
    assert said == []
    assert page.locator("figure svg").count() == count_figures(report)


@pytest.mark.parametrize("width", WIDTHS)
def test_every_figure_is_drawn(look, report, width):
    page, _, _ = look(width)
    figures = page.locator("figure")
    assert figures.count() == count_figures(report)
    for number in range(figures.count()):
        box = figures.nth(number).locator("svg").bounding_box()
        assert box["width"] > 200
        assert box["height"] > 100
        marks = figures.nth(number).locator("svg g[class*='role-mark'] :is(path, text, line, rect)")
        sizes = marks.evaluate_all(
            "all => all.map(one => one.getBBox()).filter(box => box.width + box.height > 0).length"
        )
        assert sizes >= 1


@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_never_scrolls_sideways(look, width):
    page, _, _ = look(width)
    page.locator("details").evaluate_all("all => all.forEach(one => { one.open = true })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    outside = page.evaluate(
        f"""[...document.querySelectorAll("body *")].filter((one) => !one.closest(".scroll, .hidden, .skip, caption")
            && one.getBoundingClientRect().right > {width} + 0.5).map((one) => one.outerHTML.slice(0, 80))"""
    )
    assert outside == []


def test_wide_figures_scroll_in_their_own_box_on_a_phone(look):
    page, _, _ = look(390)
    wide = "#figure-3 .scroll"
    assert page.locator(wide).first.evaluate("one => one.scrollWidth > one.clientWidth")
    page.locator(wide).first.focus()
    assert page.locator(wide).first.evaluate("one => document.activeElement === one")


@pytest.mark.parametrize("width", WIDTHS)
def test_labels_in_figures_are_large_enough_to_read(look, width):
    page, _, _ = look(width)
    assert min(pixels for *_, pixels in page.evaluate(LABELS)) >= 9


def test_the_keyboard_reaches_everything_in_order(look):
    page, _, _ = look()
    reachable = page.locator("a, summary, .scroll").evaluate_all("all => all.length")
    closed = page.locator("details:not([open]) .scroll").count()
    reached = []
    for _ in range(reachable - closed):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate("""() => {
                const one = document.activeElement;
                return [one.tagName, one.className, one.getBoundingClientRect().top + scrollY];
            }""")
        )
    assert reached[0][1] == "skip"
    tags = [tag for tag, *_ in reached]
    assert tags.count("SUMMARY") == page.locator("summary").count()
    assert tags.count("A") == page.locator("a").count()
    assert "BODY" not in tags
    places = [top for *_, top in reached[1:]]
    assert all(after >= before - 40 for before, after in itertools.pairwise(places))


def test_details_open_with_the_keyboard(look):
    page, _, _ = look()
    summary = page.locator("#figure-1 summary")
    summary.focus()
    page.keyboard.press("Enter")
    table = page.locator("#figure-1 details table")
    assert table.is_visible()
    assert table.locator("tbody tr").count() >= 6


def test_contents_lead_to_their_figures(look):
    page, _, _ = look(reduced_motion="reduce")
    page.locator("nav a[href='#figure-3']").focus()
    page.keyboard.press("Enter")
    assert page.url.endswith("#figure-3")
    assert abs(page.locator("#figure-3").bounding_box()["y"]) < 60


def test_headings_are_in_order(look):
    page, _, _ = look()
    levels = page.locator("h1, h2, h3, h4").evaluate_all("all => all.map((one) => Number(one.tagName[1]))")
    assert levels[0] == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_of_its_ground(look, scheme):
    page, _, _ = look(color_scheme=scheme)
    page.locator("details").evaluate_all("all => all.forEach(one => { one.open = true })")
    texts = page.evaluate(TEXTS)
    assert len(texts) > 100
    for color, ground, text in texts:
        assert contrast(hexed(color), hexed(ground)) >= 4.5, text


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_labels_in_figures_stand_out_of_the_paper(look, scheme):
    page, _, _ = look(color_scheme=scheme)
    paper = hexed(numbers(page.evaluate("getComputedStyle(document.body).backgroundColor")))
    labels = page.evaluate(LABELS)
    assert len(labels) > 100
    cells = {"#000000", "#ffffff"}  # of the heat maps, chosen by the colour of the cell
    for fill, stroke, text, _ in labels:
        color = hexed(numbers(fill))
        if color in cells or hexed(numbers(stroke)) == paper:
            continue
        assert contrast(color, paper) >= 4.5, text


def numbers(color):
    return [float(part) for part in re.findall(r"[\d.]+", color)]


def hexed(channels):
    return "#" + "".join(f"{round(channel):02x}" for channel in channels[:3])
