// Shows the rows that contain all words in the field, which is hidden without this script.
const filter = document.getElementById("page-filter");
const field = filter.querySelector("input");
const rows = [...document.querySelectorAll("table.variables tr[id]")];
const words = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
field.addEventListener("input", () => {
  const wanted = field.value.toLowerCase().split(/\s+/);
  for (const row of rows) {
    row.hidden = !wanted.every((word) => words.get(row).includes(word));
    // A matrix has its start values in a separate row.
    const next = row.nextElementSibling;
    if (next?.querySelector("details")) next.hidden = row.hidden;
  }
  for (const group of document.querySelectorAll("table.variables > tbody, #page-variables section"))
    group.hidden = !group.querySelector("tr[id]:not([hidden])");
  const count = rows.filter((row) => !row.hidden).length;
  filter.querySelector("output").value =
    count ? `${count} of ${rows.length}` : `None of the ${rows.length} variables matches “${field.value}”.`;
});
filter.hidden = false;
// What a link leads to must not hide under the filter, the page's own fragment included.
const clear = () => document.documentElement.style.setProperty("--filter", `${filter.offsetHeight}px`);
clear();
new ResizeObserver(clear).observe(filter);
