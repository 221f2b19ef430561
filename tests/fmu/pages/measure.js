// What of a page is wider than its window, which numbers break, which texts of the drawing lie over others or over the
// edge of a part, and which plots and controls are in view.
() => {
  const isShown = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true })
    && !element.closest(".hidden, .modebar") && element.getClientRects().length > 0;
  const name = (element) => `${element.localName}#${element.id} ${element.textContent.trim().slice(0, 40)}`;
  const shown = [...document.querySelectorAll("main, main *, header, header *")].filter(isShown);
  // Pictures clip their parts.
  const isWide = (element) => {
    if (element.ownerSVGElement && element.localName !== "text") return false;
    const { left, right } = element.getBoundingClientRect();
    return left < 0 || right > innerWidth + 0.5;
  };
  const broken = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const element = node.parentElement;
    if (element.closest("script, style, template, noscript") || !isShown(element)) continue;
    for (const { index, 0: number } of node.data.matchAll(/[−-]?\d[\d.,]*/g)) {
      const range = document.createRange();
      range.setStart(node, index);
      range.setEnd(node, index + number.length);
      const lines = new Set([...range.getClientRects()].map((box) => Math.round(box.top)));
      if (lines.size > 1) broken.push(node.data);
    }
  }
  const boxOf = (element) => {
    const { left, right, top, bottom } = element.getBoundingClientRect();
    // The box of a line of text is taller than its digits: a fifth above and below.
    const margin = element.localName === "text" ? (bottom - top) / 5 : 0;
    return { left, right, top: top + margin, bottom: bottom - margin };
  };
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const isIn = (a, b) => a.left >= b.left && a.right <= b.right && a.top >= b.top && a.bottom <= b.bottom;
  const drawn = [...document.querySelectorAll("#engine :is(text, rect)")].filter(isShown);
  const texts = drawn.filter((element) => element.localName === "text" && element.textContent);
  const crossing = texts.flatMap((text, index) => drawn
    .filter((other) => other.localName === "rect" || texts.indexOf(other) > index)
    .filter((other) => meet(boxOf(text), boxOf(other)) && !isIn(boxOf(text), boxOf(other)))
    .map((other) => `${name(text)} over ${name(other)}`));
  const inView = (element) => {
    const { top, bottom, left, right } = element.getBoundingClientRect();
    return top >= 0 && left >= 0 && bottom <= innerHeight && right <= innerWidth;
  };
  const plots = [...document.querySelectorAll(".plot")];
  const names = plots.filter(inView).map((plot) => plot.data.at(-1).name);
  const others = [...document.querySelectorAll("input[type=range], #engine")].filter(inView);
  return { wide: shown.filter(isWide).map(name), broken, crossing, plots: names, others: others.map(({ id }) => id), texts: shown.length, drawn: drawn.length };
}
