"use strict";
// What every page does: marks the section in view in the navigation, says which tables scroll, folds, unfolds for print.
const links = new Map([...document.querySelectorAll("nav a")].map(link => [document.getElementById(link.hash.slice(1)), link]));
const inView = new Set();
const sectionsSeen = new IntersectionObserver(entries => {
  for (const entry of entries) inView[entry.isIntersecting ? "add" : "delete"](entry.target);
  const current = [...links.keys()].find(section => inView.has(section));
  for (const [section, link] of links) section === current ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current");
  const shown = links.get(current);
  if (shown) { const bar = shown.parentElement; bar.scrollLeft = shown.offsetLeft - bar.offsetLeft - 40; }
}, {rootMargin: "-60px 0px -60% 0px"});
for (const [section, link] of links) {
  sectionsSeen.observe(section);
  link.addEventListener("click", () => { section.querySelector("details").open = true; });
}

const widths = new ResizeObserver(entries => requestAnimationFrame(() => {
  for (const {target} of entries) {
    const more = target.scrollWidth > target.clientWidth + 1;
    target.classList.toggle("more", more);
    for (const [name, value] of Object.entries({tabindex: "0", role: "region", "aria-label": "Table, scrolls sideways"})) more ? target.setAttribute(name, value) : target.removeAttribute(name);
  }
}));
document.querySelectorAll(".scroll").forEach(each => widths.observe(each));

let folded = [];
window.addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll("main details:is(.section, .fold):not([open])")];
  folded.forEach(each => { each.open = true; });
});
window.addEventListener("afterprint", () => folded.forEach(each => { each.open = false; }));
