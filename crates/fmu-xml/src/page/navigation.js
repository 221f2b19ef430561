"use strict";
// Unfolds the contents beside the text on wide screens, and marks the current section. The page is also XML, so this
// script has no ampersands or less-than signs.
{
  const nav = document.querySelector("nav");
  const contents = nav.querySelector("details");
  const beside = matchMedia("(min-width: 68rem)");
  const fold = () => { contents.open = beside.matches; };
  fold();
  beside.addEventListener("change", fold);
  contents.addEventListener("click", (event) => { if (event.target.closest("a")) fold(); });
  addEventListener("DOMContentLoaded", () => {
    const sections = [...contents.querySelectorAll("a")].map((link) =>
      [link, document.getElementById(decodeURIComponent(link.hash.slice(1)))]);
    const mark = () => {
      const shown = sections.filter(([, section]) => section.getClientRects().length > 0);
      const isAtEnd = scrollY + innerHeight >= document.documentElement.scrollHeight - 1;
      const line = isAtEnd ? innerHeight : innerHeight / 3;
      const [read] = shown.findLast(([, section]) => line > section.getBoundingClientRect().top) ?? [];
      for (const [link] of sections) link.toggleAttribute("aria-current", link === read);
      contents.querySelector("summary span").textContent = read?.textContent ?? "";
      if (read) nav.scrollTop = read.offsetTop - nav.clientHeight / 2;
    };
    mark();
    addEventListener("scroll", mark, { passive: true });
    addEventListener("resize", mark);
  });
}
