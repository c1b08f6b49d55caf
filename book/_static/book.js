// A slider over results that the build computed. Without this script they stand in a table.
document.addEventListener("DOMContentLoaded", () => {
  for (const sweep of document.querySelectorAll(".rp-sweep")) {
    const dial = sweep.querySelector(".rp-dial");
    const input = dial.querySelector("input");
    const rows = [...sweep.querySelectorAll("tbody tr")];
    const marks = [...sweep.querySelectorAll("svg")].map((one) => [...one.querySelectorAll(".rp-at")]);
    const show = () => {
      const at = Number(input.value);
      rows.forEach((row, number) => { row.hidden = number !== at; });
      marks.forEach((set) => set.forEach((one, number) => one.classList.toggle("rp-now", number === at)));
      const setting = rows[at].querySelector("th").textContent;
      dial.querySelector("output").textContent = setting;
      input.setAttribute("aria-valuetext", setting);
    };
    input.addEventListener("input", show);
    dial.hidden = false;
    show();
  }
});

// The menu's folds are named after their part: the theme leaves them without a name.
document.addEventListener("DOMContentLoaded", () => {
  for (const summary of document.querySelectorAll(".bd-sidenav details > summary")) {
    const part = summary.closest("li").querySelector("a");
    summary.setAttribute("aria-label", `Pages below ${part.textContent.trim()}`);
  }
});

// What scrolls sideways is within a keyboard's reach, and has a name.
const reach = () => {
  for (const box of document.querySelectorAll("article :is(pre, .highlight, .math, mjx-container, .cell_output, .output, .pst-scrollable-table-container)")) {
    if (box.scrollWidth <= box.clientWidth + 1 || !/auto|scroll/.test(getComputedStyle(box).overflowX)) continue;
    box.tabIndex = 0;
    if (box.ariaLabel) continue;
    box.setAttribute("role", "group");
    box.ariaLabel = box.matches(".math, mjx-container") ? "Formula" : box.matches("pre, .highlight") ? "Code" : "Table or output";
  }
};
addEventListener("load", () => {
  reach();
  window.MathJax?.startup?.promise.then(reach);
  document.addEventListener("toggle", reach, true);
  addEventListener("resize", reach);
});
