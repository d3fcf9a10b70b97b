"use strict";
// Values under the cursor, a cursor for the keyboard, zooming and panning.
// The page is whole without this script.
(function () {
  var SVG = "http://www.w3.org/2000/svg";
  var root = document.documentElement;

  var button = document.getElementById("theme");
  button.hidden = false;
  button.addEventListener("click", function () {
    var dark = root.dataset.theme ? root.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
  });

  // What is folded on the screen is open on paper.
  var opened = [];
  addEventListener("beforeprint", function () {
    document.querySelectorAll("details:not([open])").forEach(function (fold) {
      fold.open = true;
      opened.push(fold);
    });
  });
  addEventListener("afterprint", function () {
    opened.forEach(function (fold) { fold.open = false; });
    opened = [];
  });

  function numbers(text) { return text.trim().split(/\s+/).map(Number); }

  function clamp(value, low, high) { return Math.min(Math.max(value, low), high); }

  function write(value, unit) {
    var size = Math.abs(value);
    var text = value === 0 || (size >= 1e-3 && size < 1e6)
      ? Number(value.toPrecision(4)).toString() : value.toExponential(3);
    var gap = !unit || unit === "%" ? "" : " ";
    return text.replace("-", "\u2212") + gap + (unit || "");
  }

  // An axis: from pixels to values.
  function axis(range, name, unit, start, end) {
    var part = range.split(" "), low = Number(part[0]), high = Number(part[1]);
    return {
      name: name || "",
      unit: unit || "",
      value: function (pixel) {
        var t = (pixel - start) / (end - start);
        if (part[2] === "log") { return low * Math.pow(high / low, t); }
        var value = low + (high - low) * t;
        // Places are written to a hundredth of a pixel: below that is nothing.
        return Math.abs(value) < 2e-5 * (high - low) ? 0 : value;
      }
    };
  }

  // The points of a path of straight lines; null where the pen is lifted.
  function points(d) {
    var found = [];
    (d.match(/[ML][^ML]+/g) || []).forEach(function (part) {
      var at = numbers(part.slice(1));
      if (part[0] === "M" && found.length) { found.push(null); }
      found.push(at);
    });
    return found;
  }

  function runsForward(list) {
    var last = -Infinity;
    return list.every(function (p) {
      var fine = p === null || p[0] >= last - 0.02;
      if (p) { last = p[0]; }
      return fine;
    });
  }

  // Height of a curve at an abscissa, in pixels, or null.
  function height(list, x) {
    for (var k = 1; k < list.length; k += 1) {
      var a = list[k - 1], b = list[k];
      if (a && b && a[0] <= x + 1e-6 && x <= b[0] + 1e-6) {
        return b[0] - a[0] < 1e-9 ? b[1] : a[1] + (b[1] - a[1]) * clamp((x - a[0]) / (b[0] - a[0]), 0, 1);
      }
    }
    return null;
  }

  function readPanel(group) {
    var f = numbers(group.dataset.frame);
    var panel = {
      left: f[0], top: f[1], right: f[0] + f[2], bottom: f[1] + f[3],
      title: group.dataset.title || "",
      x: axis(group.dataset.x, group.dataset.xName, group.dataset.xUnit, f[0], f[0] + f[2]),
      y: axis(group.dataset.y, group.dataset.yName, group.dataset.yUnit, f[1] + f[3], f[1]),
      curves: [], spots: []
    };
    group.querySelectorAll("g[data-label]").forEach(function (g) {
      var path = g.querySelector("path");
      if (path) { panel.curves.push({ label: g.dataset.label, points: points(path.getAttribute("d")) }); }
    });
    group.querySelectorAll("path[data-at]").forEach(function (mark) {
      var at = numbers(mark.dataset.at), title = mark.querySelector("title");
      panel.spots.push({ x: at[0], y: at[1], text: title ? title.textContent : "" });
    });
    panel.forward = panel.curves.length > 0 && panel.curves.every(function (c) {
      return runsForward(c.points);
    });
    if (!panel.forward) {
      panel.curves.forEach(function (c) {
        c.points.forEach(function (p) {
          if (p) { panel.spots.push({ x: p[0], y: p[1], label: c.label }); }
        });
      });
    }
    panel.spots = panel.spots.filter(function (s) {
      return s.x >= panel.left - 1 && s.x <= panel.right + 1 && s.y >= panel.top - 1 && s.y <= panel.bottom + 1;
    });
    panel.spots.sort(function (a, b) { return a.x - b.x || b.y - a.y; });
    return panel;
  }

  function drawing(svg) {
    var home = numbers(svg.getAttribute("viewBox"));
    return { svg: svg, home: home, view: home.slice(), panels: null, index: -1, at: null, spot: -1, ink: null };
  }

  document.querySelectorAll(".plot").forEach(function (plot) {
    var readout = plot.parentElement.querySelector(".readout");
    var drawings = Array.from(plot.querySelectorAll("svg")).map(drawing);
    var drag = null;
    plot.tabIndex = 0;

    // The one that this width of page shows.
    function current() {
      return drawings.find(function (d) { return d.svg.getClientRects().length > 0; }) || drawings[0];
    }
    function panels(d) {
      if (!d.panels) {
        d.panels = Array.from(d.svg.querySelectorAll("[data-frame]")).map(readPanel);
      }
      return d.panels;
    }
    function place(d, event) {
      var matrix = d.svg.getScreenCTM();
      return matrix ? new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse()) : null;
    }
    function show(d) {
      // The view stays inside the figure.
      [0, 1].forEach(function (k) {
        d.view[k + 2] = Math.min(d.view[k + 2], d.home[k + 2]);
        d.view[k] = clamp(d.view[k], d.home[k], d.home[k] + d.home[k + 2] - d.view[k + 2]);
      });
      d.svg.setAttribute("viewBox", d.view.join(" "));
    }
    function zoom(d, factor, x, y) {
      factor = Math.max(factor, 0.02 * d.home[2] / d.view[2]);
      d.view = [x - (x - d.view[0]) * factor, y - (y - d.view[1]) * factor,
        d.view[2] * factor, d.view[3] * factor];
      show(d);
    }
    function middle(d) {
      return d.at || { x: d.view[0] + d.view[2] / 2, y: d.view[1] + d.view[3] / 2 };
    }
    function mark(d, name, attributes) {
      var element = document.createElementNS(SVG, name);
      Object.keys(attributes).forEach(function (key) { element.setAttribute(key, attributes[key]); });
      d.ink.appendChild(element);
    }
    function erase(d) {
      if (d.ink) { d.ink.remove(); d.ink = null; }
    }

    // Puts the cursor into a panel and says what is there.
    function point(d, index, x, y) {
      var panel = panels(d)[index], text = [];
      erase(d);
      d.ink = document.createElementNS(SVG, "g");
      d.ink.setAttribute("class", "cursor");
      d.svg.appendChild(d.ink);
      d.index = index;
      x = clamp(x, panel.left, panel.right);
      if (panel.forward) {
        mark(d, "line", { x1: x, x2: x, y1: panel.top, y2: panel.bottom });
        panel.curves.forEach(function (curve) {
          var h = height(curve.points, x);
          if (h === null || h < panel.top - 1 || h > panel.bottom + 1) { return; }
          mark(d, "circle", { cx: x, cy: h, r: 3 });
          text.push((curve.label ? curve.label + " " : "") + write(panel.y.value(h), panel.y.unit));
        });
        readout.textContent = panel.x.name + " " + write(panel.x.value(x), panel.x.unit) +
          (text.length ? ": " + (panel.y.name ? panel.y.name + " " : "") + text.join(", ") : "");
        d.at = { x: x, y: y };
      } else if (panel.spots.length) {
        var best = -1, least = Infinity;
        panel.spots.forEach(function (s, k) {
          var far = Math.hypot(s.x - x, s.y - y);
          if (far < least) { least = far; best = k; }
        });
        settle(d, panel, best);
      } else {
        y = clamp(y, panel.top, panel.bottom);
        mark(d, "line", { x1: x, x2: x, y1: panel.top, y2: panel.bottom });
        mark(d, "line", { x1: panel.left, x2: panel.right, y1: y, y2: y });
        readout.textContent = panel.x.name + " " + write(panel.x.value(x), panel.x.unit) + ", " +
          panel.y.name + " " + write(panel.y.value(y), panel.y.unit);
        d.at = { x: x, y: y };
      }
    }
    function settle(d, panel, k) {
      var s = panel.spots[k];
      d.spot = k;
      d.at = { x: s.x, y: s.y };
      mark(d, "circle", { cx: s.x, cy: s.y, r: 6, "class": "ring" });
      readout.textContent = s.text || (s.label ? s.label + ": " : "") +
        panel.x.name + " " + write(panel.x.value(s.x), panel.x.unit) + ", " +
        panel.y.name + " " + write(panel.y.value(s.y), panel.y.unit);
    }
    // Abscissae of the ends of a panel's data.
    function ends(panel) {
      var all = [];
      (panel.forward ? panel.curves : []).forEach(function (c) {
        c.points.forEach(function (p) { if (p) { all.push(p[0]); } });
      });
      return all.length ? [Math.min.apply(null, all), Math.max.apply(null, all)] : [panel.left, panel.right];
    }
    // Into a panel, as far along it as in the one before.
    function enter(d, index) {
      var panel = panels(d)[index], before = panels(d)[d.index];
      var x = before && d.at
        ? panel.left + (d.at.x - before.left) / (before.right - before.left) * (panel.right - panel.left)
        : ends(panel)[0];
      point(d, index, x, panel.bottom);
    }
    // One step of the keyboard's cursor.
    function step(d, forward, far) {
      var panel = panels(d)[d.index];
      if (!panel.forward && panel.spots.length) {
        var next = clamp(d.spot + (forward ? 1 : -1) * (far ? 10 : 1), 0, panel.spots.length - 1);
        erase(d);
        point(d, d.index, panel.spots[next].x, panel.spots[next].y);
        if (d.spot !== next) { d.ink.replaceChildren(); settle(d, panel, next); }
        return;
      }
      var width = panel.right - panel.left, x = d.at.x;
      var few = panel.forward && panel.curves[0].points.length <= 60 && !far;
      var stops = few ? panel.curves[0].points.filter(Boolean).map(function (p) { return p[0]; }) : [];
      var ahead = stops.filter(function (s) { return forward ? s > x + 0.05 : s < x - 0.05; });
      var to = ahead.length ? (forward ? ahead[0] : ahead[ahead.length - 1])
        : few ? x : x + (forward ? 1 : -1) * width * (far ? 0.1 : 0.01);
      point(d, d.index, to, d.at.y);
    }
    // A zoomed view follows the cursor.
    function follow(d) {
      if (!d.at) { return; }
      ["x", "y"].forEach(function (key, k) {
        if (d.at[key] < d.view[k] || d.at[key] > d.view[k] + d.view[k + 2]) {
          d.view[k] = d.at[key] - d.view[k + 2] / 2;
        }
      });
      show(d);
    }
    function panelAt(d, at) {
      return panels(d).findIndex(function (p) {
        return at.x >= p.left && at.x <= p.right && at.y >= p.top && at.y <= p.bottom;
      });
    }

    function hover(event) {
      var d = current(), at = place(d, event);
      if (!at) { return; }
      if (drag) {
        d.view[0] += drag.x - at.x;
        d.view[1] += drag.y - at.y;
        show(d);
        return;
      }
      var index = panelAt(d, at);
      if (index >= 0) { point(d, index, at.x, at.y); } else { erase(d); readout.textContent = ""; }
    }
    plot.addEventListener("pointermove", hover);
    plot.addEventListener("pointerdown", function (event) {
      var d = current();
      if (event.button === 0 && d.view[2] < d.home[2]) {
        drag = place(d, event);
        plot.setPointerCapture(event.pointerId);
      } else {
        hover(event);
      }
    });
    ["pointerup", "pointercancel"].forEach(function (name) {
      plot.addEventListener(name, function () { drag = null; });
    });
    plot.addEventListener("pointerleave", function (event) {
      // What a finger has pointed at stays.
      if (event.pointerType !== "touch" && document.activeElement !== plot) { erase(current()); readout.textContent = ""; }
    });
    plot.addEventListener("focus", function () {
      if (plot.matches(":focus-visible")) {
        readout.textContent = (panels(current()).length ? "arrows move the cursor, " : "") +
          "+ and \u2212 zoom, 0 shows all";
      }
    });
    plot.addEventListener("blur", function () { erase(current()); readout.textContent = ""; });
    plot.addEventListener("wheel", function (event) {
      var d = current(), at = place(d, event);
      if (at && (event.ctrlKey || document.activeElement === plot)) {
        event.preventDefault();
        zoom(d, event.deltaY < 0 ? 0.85 : 1 / 0.85, at.x, at.y);
      }
    }, { passive: false });

    function reset(d) { d.view = d.home.slice(); show(d); }
    plot.addEventListener("dblclick", function () { reset(current()); });
    plot.addEventListener("keydown", function (event) {
      var d = current(), at = middle(d), key = event.key;
      if (event.ctrlKey || event.altKey || event.metaKey) { return; }
      if (key === "+" || key === "=") { zoom(d, 0.8, at.x, at.y); }
      else if (key === "-") { zoom(d, 1.25, at.x, at.y); }
      else if (key === "0") { reset(d); }
      else if (key === "Escape") { erase(d); readout.textContent = ""; reset(d); }
      else if (/^Arrow|^Home$|^End$/.test(key) && panels(d).length) {
        if (d.index < 0 || !d.ink) { enter(d, Math.max(d.index, 0)); }
        else if (key === "ArrowLeft" || key === "ArrowRight") { step(d, key === "ArrowRight", event.shiftKey); }
        else if (key === "Home" || key === "End") {
          point(d, d.index, ends(panels(d)[d.index])[key === "Home" ? 0 : 1], d.at.y);
        } else {
          enter(d, clamp(d.index + (key === "ArrowDown" ? 1 : -1), 0, panels(d).length - 1));
        }
        follow(d);
      } else { return; }
      event.preventDefault();
    });

    var tools = document.createElement("div");
    tools.className = "tools";
    [["+", "Zoom in", function (d) { var m = middle(d); zoom(d, 0.7, m.x, m.y); }],
      ["\u2212", "Zoom out", function (d) { var m = middle(d); zoom(d, 1 / 0.7, m.x, m.y); }],
      ["\u2922", "Show all", reset]].forEach(function (tool) {
      var b = document.createElement("button");
      b.type = "button";
      b.textContent = tool[0];
      b.title = tool[1];
      b.setAttribute("aria-label", tool[1]);
      b.tabIndex = -1;
      b.addEventListener("click", function () { tool[2](current()); });
      tools.appendChild(b);
    });
    plot.parentElement.insertBefore(tools, plot);
  });
}());
