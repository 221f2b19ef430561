// What of a page breaks its rules, as texts by rule.
() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const known = new Map();
  const rgba = (color) => {
    if (!known.has(color)) {
      canvas.clearRect(0, 0, 1, 1);
      canvas.fillStyle = color;
      canvas.fillRect(0, 0, 1, 1);
      const [red, green, blue, alpha] = canvas.getImageData(0, 0, 1, 1).data;
      known.set(color, [red, green, blue, alpha / 255]);
    }
    return known.get(color);
  };
  const over = ([r, g, b, alpha], below) =>
    [...[r, g, b].map((value, index) => alpha * value + (1 - alpha) * below[index]), 1];
  // Relative luminance and contrast of WCAG 2.1.
  const luminance = (color) => {
    const [red, green, blue] = color.slice(0, 3).map((value) => {
      const share = value / 255;
      return share <= 0.03928 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  };
  const contrast = (one, other) => {
    const [dark, light] = [luminance(one), luminance(other)].sort((a, b) => a - b);
    return (light + 0.05) / (dark + 0.05);
  };

  const ancestors = (element) => element ? [element, ...ancestors(element.parentElement)] : [];
  const isShown = (element) => element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length > 0;
  const name = (element) => {
    const label = element.getAttribute("aria-label") ?? element.textContent.trim().slice(0, 40);
    return `<${element.localName} class="${element.getAttribute("class") ?? ""}"> ${label}`;
  };

  // Behind a text in a picture may be a rectangle, drawn earlier.
  const rectangles = new Map();
  const behind = (element) => {
    const svg = element.ownerSVGElement;
    if (!svg) return [];
    if (!rectangles.has(svg)) {
      const all = [...svg.querySelectorAll("rect")];
      const filled = ({ fill, fillOpacity }) => [...rgba(fill).slice(0, 3), rgba(fill)[3] * fillOpacity];
      rectangles.set(svg, all.map((rect) => [rect, rect.getBoundingClientRect(), filled(getComputedStyle(rect))]));
    }
    const box = element.getBoundingClientRect();
    const [x, y] = [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
    return rectangles.get(svg).filter(([rect, { left, right, top, bottom }]) =>
      left <= x && x <= right && top <= y && y <= bottom
      && rect.compareDocumentPosition(element) & Node.DOCUMENT_POSITION_FOLLOWING).map(([, , fill]) => fill).reverse();
  };
  const ground = (element) => {
    const layers = [...behind(element), ...ancestors(element).map((each) => rgba(getComputedStyle(each).backgroundColor))];
    return layers.reverse().reduce((below, layer) => over(layer, below), rgba(getComputedStyle(document.documentElement).getPropertyValue("--paper")));
  };

  const faint = new Set(), small = new Set(), broken = new Set(), split = new Set(), wide = new Set();
  const judge = (element, style, text) => {
    const below = ground(element);
    const [red, green, blue, alpha] = rgba(element.ownerSVGElement ? style.fill : style.color);
    const opacity = ancestors(element).reduce((product, each) => product * getComputedStyle(each).opacity, alpha);
    const ratio = contrast(over([red, green, blue, opacity], below), below);
    if (ratio < 4.5) faint.add(`${ratio.toFixed(2)}: ${text}`);
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const judged = new Set();
  while (walker.nextNode()) {
    const node = walker.currentNode, element = node.parentElement;
    if (!node.data.trim() || element.closest("script, style, noscript, title, desc") || !isShown(element)) continue;
    // Names of variables break between their words.
    if (element.closest("var, .variables code, .unit a")) {
      const range = document.createRange();
      range.selectNodeContents(node);
      const lines = new Set([...range.getClientRects()].map((box) => Math.round(box.top)));
      if (lines.size > 1) broken.add(node.data);
    }
    // No number is on two lines.
    for (const { 0: number, index } of node.data.matchAll(/(?<![\w-])[-\u2212]?\d+(\.\d+)?(e-?\d+)?(?![\w-])/g)) {
      const range = document.createRange();
      range.setStart(node, index);
      range.setEnd(node, index + number.length);
      // The boxes of a picture's characters differ by less than a line.
      const boxes = [...range.getClientRects()];
      if (boxes.some((box) => Math.abs(box.top - boxes[0].top) > box.height / 2)) split.add(number);
    }
    if (judged.has(element)) continue;
    judged.add(element);
    const style = getComputedStyle(element);
    judge(element, style, `${name(element)}`);
    if (element.closest("math, sub, sup, tspan[baseline-shift], tspan[dy]")) continue;
    const matrix = element.ownerSVGElement ? element.getScreenCTM() : { a: 1, b: 0 };
    const size = parseFloat(style.fontSize) * Math.hypot(matrix.a, matrix.b);
    if (size < 10) small.add(`${size.toFixed(1)} px: ${name(element)}`);
  }
  for (const input of document.querySelectorAll("[placeholder]"))
    judge(input, getComputedStyle(input, "::placeholder"), `placeholder ${input.placeholder}`);

  // Beyond the window is what a container scrolls, but never a plot.
  const scrolls = (element) => ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
  for (const element of [...document.querySelectorAll("body *")].filter(isShown)) {
    const isScrolled = element.ownerSVGElement || ancestors(element.parentElement).some(scrolls);
    if (isScrolled && !element.matches(".plot, .plot > *")) continue;
    if (element.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5) wide.add(name(element));
  }

  const unreachable = new Set(), unmarked = new Set();
  const controls = "a[href], button, input, select, textarea, summary, [role=button], [tabindex], [onclick]";
  for (const control of [...document.querySelectorAll(controls)].filter(isShown)) {
    control.focus({ preventScroll: true });
    if (document.activeElement !== control || control.tabIndex < 0) unreachable.add(name(control));
    else if (getComputedStyle(control).outlineStyle === "none") unmarked.add(name(control));
  }
  // A cell contains its text.
  const clipped = new Set();
  for (const cell of [...document.querySelectorAll("th, td")].filter((each) => each.textContent.trim() && !each.querySelector(".wide") && isShown(each))) {
    const range = document.createRange();
    range.selectNodeContents(cell);
    const [{ right, left }, box] = [range.getBoundingClientRect(), cell.getBoundingClientRect()];
    if (right > box.right + 1 || left < box.left - 1) clipped.add(name(cell));
  }
  const cut = new Set(), scrolled = new Set();
  for (const element of [...document.querySelectorAll("main *")].filter(isShown)) {
    const { overflowX, backgroundAttachment } = getComputedStyle(element);
    if (!["auto", "scroll"].includes(overflowX) || element.scrollWidth <= element.clientWidth) continue;
    if (!backgroundAttachment.includes("local")) cut.add(name(element));
    if (element.querySelector("table")) scrolled.add(name(element));
    element.focus({ preventScroll: true });
    if (!element.contains(document.activeElement) && !element.querySelector("a[href]")) unreachable.add(name(element));
  }
  document.activeElement.blur();

  const lists = { faint, small, broken, split, wide, unreachable, unmarked, clipped, cut, scrolled };
  return {
    ...Object.fromEntries(Object.entries(lists).map(([rule, found]) => [rule, [...found]])),
    texts: judged.size,
    controls: document.querySelectorAll(controls).length,
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
}
