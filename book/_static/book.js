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

// A table to sort and to filter. Without this script it stands in the order of print.
document.addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll("table.rp-sortable")) {
    const [body, heads] = [table.tBodies[0], [...table.tHead.rows[0].cells]];
    // Powers of ten, and a minus, as a script reads them.
    const power = /(\s*×\s*|\b)10(?=[⁻⁰-⁹¹²³])/u;
    const text = (cell) => cell.textContent.trim().replace(power, (_, times) => (times ? "e" : "1e")).normalize("NFKC").replaceAll("−", "-");
    const rows = [...body.rows].map((row) => ({ row, cells: [...row.cells].map(text) }));
    const verdict = heads.findIndex((head) => head.textContent === "Verdict");
    const bar = document.createElement("p");
    bar.className = "rp-filter";
    bar.innerHTML = '<label>Filter <input type="search" autocomplete="off"></label> <output></output>';
    table.closest(".rp-scroll").before(bar);
    const filter = () => {
      const words = bar.querySelector("input").value.toLowerCase().split(/\s+/).filter(Boolean);
      const known = new Set(verdict < 0 ? [] : rows.map((one) => one.cells[verdict].split(" ")[0]));
      // The name of a verdict is looked for among verdicts, any other word in the whole row.
      const fits = (one, word) => (known.has(word) ? one.cells[verdict].startsWith(word) : one.row.textContent.toLowerCase().includes(word));
      for (const one of rows) one.row.hidden = !words.every((word) => fits(one, word));
      bar.querySelector("output").textContent = `${rows.filter((one) => !one.row.hidden).length} of ${rows.length} shown`;
    };
    // Numbers come before words, and what is empty last, whichever way round.
    const number = (word) => parseFloat(word.match(/^[^\w-]*(-?\d.*)/)?.[1]);
    const kind = (word) => (word ? (isNaN(number(word)) ? 1 : 0) : 2);
    const compare = (a, b) => (kind(a) ? a.localeCompare(b, "en", { numeric: true }) : number(a) - number(b));
    heads.forEach((head, at) => {
      const button = document.createElement("button");
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const turn = head.ariaSort === "ascending" ? -1 : 1;
        heads.forEach((other) => { other.ariaSort = null; });
        head.ariaSort = turn > 0 ? "ascending" : "descending";
        rows.sort(({ cells: a }, { cells: b }) => kind(a[at]) - kind(b[at]) || turn * compare(a[at], b[at]));
        body.append(...rows.map((one) => one.row));
      });
    });
    bar.addEventListener("input", filter);
    filter();
  }
});
