"use strict";
{
  const night = matchMedia("(prefers-color-scheme: dark)");
  const buttons = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const panelsOf = root => [...root.querySelectorAll(".panel")];
  const plotOf = panel => panel.querySelector(".plot");

  // The data name the style sheet's colours.
  const plotted = panel => {
    const style = getComputedStyle(document.documentElement);
    const colored = (_, value) =>
      typeof value === "string" && value.startsWith("--") ? style.getPropertyValue(value).trim() : value;
    const { data, layout } = JSON.parse(panel.querySelector("script").textContent, colored);
    panel.querySelectorAll("input").forEach(box => { data[box.value].visible = box.checked; });
    const [ink, faint, paper, rule] = ["--ink", "--faint", "--paper", "--rule"].map(name => style.getPropertyValue(name).trim());
    const text = { color: ink, size: 12, family: getComputedStyle(document.body).fontFamily };
    return [data, {
      ...layout, font: text, uirevision: true, paper_bgcolor: "transparent", plot_bgcolor: "transparent",
      hoverlabel: { bgcolor: paper, bordercolor: rule, font: text, namelength: -1 }, modebar: { bgcolor: paper, color: faint, activecolor: ink },
      // On a touch screen a finger scrolls the page.
      dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom",
    }];
  };
  const draw = panels => Promise.all(panels.map(panel => Plotly.react(plotOf(panel), ...plotted(panel), buttons)));

  const following = new Set();
  const link = panel => {
    const others = panelsOf(panel.closest("figure"))
      .filter(other => other !== panel && panel.dataset.axis && other.dataset.axis === panel.dataset.axis);
    plotOf(panel).on("plotly_relayout", change => {
      // A following panel does not lead others.
      if (following.delete(panel)) return;
      const range = Object.entries(change).filter(([key]) => key.startsWith("xaxis."));
      if (range.length === 0) return;
      others.forEach(other => {
        following.add(other);
        Plotly.relayout(plotOf(other), Object.fromEntries(range));
      });
    });
  };
  const serveKeyboard = plot => plot.querySelectorAll(".modebar-btn").forEach(button => {
    button.tabIndex = 0;
    button.setAttribute("role", "button");
    button.setAttribute("aria-label", button.dataset.title);
  });

  // Draws the figures in a part of the page; pages that create figures themselves call it too.
  globalThis.showFigures = async root => {
    const panels = panelsOf(root);
    await draw(panels);
    for (const panel of panels) {
      const plot = plotOf(panel);
      link(panel);
      serveKeyboard(plot);
      plot.on("plotly_afterplot", () => serveKeyboard(plot));
      plot.addEventListener("keydown", event => {
        if (event.key === "Enter" && event.target.matches(".modebar-btn")) event.target.dispatchEvent(new MouseEvent("click"));
      });
      panel.querySelectorAll("input").forEach(box =>
        box.addEventListener("change", () => Plotly.restyle(plot, { visible: box.checked }, [Number(box.value)])));
    }
    document.documentElement.dataset.drawn = panels.length;
  };
  // Paper is narrower than most windows: the rows get the width between the margins of A4 and Letter.
  const fit = width => {
    document.querySelectorAll(".row").forEach(row => { row.style.width = width; });
    panelsOf(document).map(plotOf).forEach(plot => Plotly.relayout(plot, { width: width ? plot.clientWidth : null, autosize: !width }));
  };
  addEventListener("beforeprint", () => fit("182mm"));
  addEventListener("afterprint", () => fit(""));
  showFigures(document);
  night.addEventListener("change", () => draw(panelsOf(document)));
}
