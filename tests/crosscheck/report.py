"""The report page in a real browser: headless Chromium by Playwright.

    python tests/crosscheck/report.py REPORT.html [FOLDER]

Checks that the page asks nothing of the network and makes no console errors,
that hovering and the keyboard give the values that the marks carry, that zoom,
theme and folds work, that paper and phone lose nothing, and that the page is
whole without scripts. With FOLDER it leaves screenshots and the printed PDF
there, to be looked at.
"""

import os
import re
import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

SECTIONS = [
    "Summary",
    "Vehicle",
    "Trim",
    "One revolution",
    "Modes in hover",
    "Frequency responses in hover",
    "Control law",
    "Gain schedule",
    "Margins and verification",
    "Provenance",
]
DESK, PHONE = {"width": 1200, "height": 900}, {"width": 390, "height": 800}
# A4 less the margins of the style sheet, px.
PAPER = {"width": 688, "height": 1000}
SMALLEST_LETTERS = 6.5  # px on a phone

failures = []
checks = 0


def check(what, holds, detail=""):
    global checks
    checks += 1
    if not holds:
        failures.append(f"{what}: {detail}")
        print(f"FAILED {what}: {detail}")


def number(text):
    return float(re.search(r"-?\d+(\.\d+)?(e[-+]?\d+)?", text.replace("\u2212", "-")).group())


def opened(browser, path, **options):
    context = browser.new_context(**options)
    page = context.new_page()
    said = []
    asked = []
    page.on("console", lambda m: said.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda e: said.append(str(e)))
    page.on("request", lambda r: asked.append(r.url))
    page.goto(path.as_uri())
    return page, said, asked


def outside(page):
    """Elements that stick out of the page to the right, scrolled boxes aside."""
    return page.evaluate(
        """() => {
        const edge = document.documentElement.clientWidth + 1, found = [];
        document.querySelectorAll('main *').forEach(e => {
            if (e.closest('svg') && e.tagName !== 'svg') return;
            let box = e.parentElement;
            while (box && !['auto', 'scroll', 'hidden'].includes(getComputedStyle(box).overflowX)) box = box.parentElement;
            const r = e.getBoundingClientRect();
            if (!box && r.width > 0 && r.right > edge) found.push(e.tagName + '.' + e.getAttribute('class') + ' ' + r.right);
        });
        return found;
    }"""
    )


def desk(browser, path, folder):
    page, said, asked = opened(browser, path, viewport=DESK, color_scheme="light")
    headings = page.locator("h2").all_text_contents()
    for section in SECTIONS:
        check("section", section in headings, f"{section} not among {headings}")
    links = page.eval_on_selector_all("nav a", "all => all.map(a => a.getAttribute('href'))")
    check("contents", len(links) == len(headings) and all(page.locator(l).count() == 1 for l in links))
    plots = page.locator(".plot")
    count = plots.count()
    check("figures", count >= 12, f"{count}")
    for k in range(count):
        plot = plots.nth(k)
        name = plot.get_attribute("aria-label") or ""
        check("name of a figure", re.match(r"Figure \d+\. \S", name), name)
        check("caption", len(plot.locator("xpath=..").locator("figcaption").inner_text()) > 20, name)
    hovering(page)
    keyboard(page)
    themes(page)
    page.locator("summary").first.click()
    check("fold opens", page.locator("details[open]").count() == 1)
    page.locator("summary").first.click()
    check("nothing sticks out", not outside(page), outside(page))
    if folder:
        page.mouse.move(5, 5)
        page.screenshot(path=folder / "light.png", full_page=True)
    paper(page, folder)
    check("console", not said, said)
    check("network", all(url.startswith("file:") for url in asked) and len(asked) == 1, asked)
    page.context.close()


def hovering(page):
    """Pointing at a mark of a curve reads the value that the mark was drawn with."""
    tried = 0
    for figure in page.locator("figure").all():
        readout = figure.locator(".readout")
        panels = figure.locator("svg:visible [data-frame]")
        for k in range(min(panels.count(), 2)):
            panel = panels.nth(k)
            panel.scroll_into_view_if_needed()
            box = panel.evaluate(
                """g => { const s = g.ownerSVGElement.getBoundingClientRect(), v = g.ownerSVGElement.viewBox.baseVal,
                f = g.dataset.frame.split(' ').map(Number), u = s.width / v.width;
                return [s.x + u * (f[0] + f[2] / 2), s.y + u * (f[1] + f[3] / 2)]; }"""
            )
            page.mouse.move(*box)
            text = readout.text_content()
            check("value under the cursor", re.search(r"\d", text), f"{figure.inner_text()[:60]!r}: {text!r}")
        # A mark in the middle of a curve over a common abscissa.
        marks = figure.locator("svg:visible [data-frame] > g:not([data-label]) > path[data-at]")
        if panels.count() == 0 or marks.count() < 12 or panels.first.locator("g[data-label]").count() == 0:
            continue
        mark = marks.nth(5)
        words = mark.locator("title").text_content()
        if ": " not in words:
            continue
        mark.scroll_into_view_if_needed()
        box = mark.bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        text = readout.text_content()
        label, values = words.split(": ", 1)
        x, y = values.split(", ")
        found = re.search(re.escape(label) + r" (\S+)", text)
        if not found or ":" not in text:
            continue
        tried += 1
        span = float(page.evaluate("m => { const y = m.closest('[data-y]').dataset.y.split(' '); return y[1] - y[0]; }", mark.element_handle()))
        near = abs(number(found.group(1)) - number(y)) < 0.02 * span
        check("value at a mark", near, f"{words!r} read as {text!r}")
    check("marks tried", tried >= 2, tried)


def keyboard(page):
    plot = page.locator(".plot:has([data-label])").first
    readout = plot.locator("xpath=..").locator(".readout")
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")
    for _ in range(80):
        page.keyboard.press("Tab")
        if plot.evaluate("p => p === document.activeElement"):
            break
    check("plots are reached by Tab", plot.evaluate("p => p === document.activeElement"))
    check("keys are told", "arrows" in readout.text_content(), readout.text_content())
    trim = page.locator("figure", has_text="with and without").first.locator(".plot")
    readout = trim.locator("xpath=..").locator(".readout")
    page.mouse.move(5, 5)
    trim.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Home")
    first = readout.text_content()
    check("cursor starts at the first point", number(first) == 0 and "interactions on" in first, first)
    page.keyboard.press("ArrowRight")
    second = readout.text_content()
    check("cursor moves from point to point", abs(number(second) - 5) < 0.02, second)
    page.keyboard.press("ArrowDown")
    third = readout.text_content()
    check("down goes to the next panel", "roll" in third and third != second, third)
    page.keyboard.press("End")
    check("end is the last point", abs(number(readout.text_content()) - 90) < 0.1, readout.text_content())
    svg = trim.locator("svg:visible")
    home = svg.get_attribute("viewBox")
    page.keyboard.press("+")
    width = lambda: float(svg.get_attribute("viewBox").split()[2])
    whole = float(home.split()[2])
    check("plus zooms in", width() < 0.9 * whole, svg.get_attribute("viewBox"))
    page.keyboard.press("-")
    page.keyboard.press("-")
    check("minus stays within the figure", abs(width() - whole) < 1e-6)
    page.keyboard.press("+")
    page.keyboard.press("0")
    check("0 shows all", [float(v) for v in svg.get_attribute("viewBox").split()] == [float(v) for v in home.split()])
    figure = trim.locator("xpath=..")
    figure.get_by_role("button", name="Zoom in").click()
    check("button zooms in", width() < 0.9 * whole)
    figure.get_by_role("button", name="Show all").click()
    check("button shows all", abs(width() - whole) < 1e-6)
    check("a cursor is drawn", svg.locator(".cursor").count() == 0 or svg.locator(".cursor circle").count() >= 1)
    # The eigenvalues are points: arrows go from one to the next.
    plane = page.locator("figure", has_text="imaginary axis").first.locator(".plot")
    readout = plane.locator("xpath=..").locator(".readout")
    plane.focus()
    seen = set()
    for _ in range(6):
        page.keyboard.press("ArrowRight")
        seen.add(readout.text_content())
    check("arrows go through eigenvalues", len(seen) >= 4 and all("rad/s" in s for s in seen), seen)
    page.keyboard.press("Escape")


def themes(page):
    ground = lambda: page.evaluate("getComputedStyle(document.body).backgroundColor")
    ink = lambda: page.evaluate("getComputedStyle(document.querySelector('.cx-plot text')).fill")
    before = (ground(), ink())
    page.get_by_role("button", name="Light or dark").click()
    after = (ground(), ink())
    check("the theme button changes page and plots", before[0] != after[0] and before[1] != after[1], (before, after))
    page.get_by_role("button", name="Light or dark").click()
    check("and back", (ground(), ink()) == before)


def paper(page, folder):
    page.set_viewport_size(PAPER)
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    check("folds open on paper", page.locator("details:not([open])").count() == 0)
    check("nothing is cut on paper", not outside(page), outside(page))
    hidden = page.eval_on_selector_all(
        ".scroll, pre, .plot", "all => all.filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.className)"
    )
    check("nothing scrolls on paper", not hidden, hidden)
    white = page.evaluate("getComputedStyle(document.body).backgroundColor")
    check("paper is white", white in ("rgb(255, 255, 255)", "rgba(0, 0, 0, 0)"), white)
    tall = page.eval_on_selector_all("figure", "all => Math.max(...all.map(f => f.getBoundingClientRect().height))")
    check("every figure fits a sheet", tall < 1017, tall)
    pdf = page.pdf(format="A4", path=folder / "print.pdf" if folder else None)
    sheets = len(re.findall(rb"/Type\s*/Page\b", pdf))
    check("sheets", 8 <= sheets <= 40, sheets)
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    check("folds close again", page.locator("details[open]").count() == 0)


def dark(browser, path, folder):
    page, said, _ = opened(browser, path, viewport=DESK, color_scheme="dark")
    light = page.evaluate(
        """() => { const c = e => getComputedStyle(e).getPropertyValue(e.tagName === 'BODY' ? 'background-color' : 'fill')
            .match(/\\d+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0);
            return [c(document.body), c(document.querySelector('.cx-plot text'))]; }"""
    )
    check("dark ground, light letters", light[0] < 150 < 500 < light[1], light)
    check("console, dark", not said, said)
    if folder:
        page.screenshot(path=folder / "dark.png", full_page=True)
    page.context.close()


def phone(browser, path, folder):
    page, said, _ = opened(browser, path, viewport=PHONE, color_scheme="light", has_touch=True, is_mobile=True)
    width = page.evaluate("document.documentElement.scrollWidth")
    check("no sideways scrolling on a phone", width <= PHONE["width"], width)
    check("nothing sticks out on a phone", not outside(page), outside(page))
    letters = page.evaluate(
        """() => Array.from(document.querySelectorAll('.plot svg')).filter(s => s.getClientRects().length).map(s => {
            const u = s.getBoundingClientRect().width / s.viewBox.baseVal.width;
            return u * Math.min(...Array.from(s.querySelectorAll('text')).map(t => parseFloat(t.getAttribute('font-size')) || 99)); })"""
    )
    check("letters can be read on a phone", min(letters) >= SMALLEST_LETTERS, min(letters))
    panel = page.locator("figure", has_text="with and without").first.locator("svg:visible [data-frame]").first
    panel.scroll_into_view_if_needed()
    box = panel.bounding_box()
    page.touchscreen.tap(box["x"] + 0.6 * box["width"], box["y"] + 0.4 * box["height"])
    text = page.locator("figure", has_text="with and without").first.locator(".readout").text_content()
    check("a tap reads values", "interactions on" in text, text)
    check("console, phone", not said, said)
    if folder:
        page.screenshot(path=folder / "phone.png", full_page=True)
    page.context.close()


def without_scripts(browser, path):
    page, _, _ = opened(browser, path, viewport=DESK, java_script_enabled=False)
    shown = page.locator(".plot svg:visible").count()
    check("figures without scripts", shown == page.locator(".plot").count(), shown)
    check("no dead button without scripts", not page.locator("#theme").is_visible())
    check("values without scripts", page.locator("svg:visible path[data-at] title").count() > 100)
    page.context.close()


def main():
    path = Path(sys.argv[1]).resolve()
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        # Its sandbox needs rights that containers seldom give; the page is ours.
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        desk(browser, path, folder)
        dark(browser, path, folder)
        phone(browser, path, folder)
        without_scripts(browser, path)
        browser.close()
    print(f"{checks - len(failures)} passed, {len(failures)} failed")
    sys.exit(1 if failures else 0)


main()
