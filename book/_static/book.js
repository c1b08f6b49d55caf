// A slider over results that the build computed. Without this script they stand in a table.
document.addEventListener("DOMContentLoaded", () => {
  for (const sweep of document.querySelectorAll(".rp-sweep")) {
    const dial = sweep.querySelector(".rp-dial");
    const input = dial.querySelector("input");
    const rows = [...sweep.querySelectorAll("tbody tr")];
    const points = [...sweep.querySelectorAll("[clip-path] > use")];
    const show = () => {
      const at = Number(input.value);
      rows.forEach((row, number) => { row.hidden = number !== at; });
      points.forEach((one, number) => one.classList.toggle("rp-other", number % rows.length !== at));
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
  // A formula is no control: only one that scrolls is a stop of the Tab key.
  window.MathJax?.startup?.promise.then(() => {
    for (const one of document.querySelectorAll("mjx-container[tabindex]")) one.removeAttribute("tabindex");
    reach();
  });
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
    const verdict = heads.findIndex((head) => head.textContent === "verdict");
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

// The typesetting of formulas moves the target of a link: it stays in place until a reader acts.
document.addEventListener("DOMContentLoaded", () => {
  const reached = () => document.getElementById(decodeURIComponent(location.hash.slice(1)));
  // A link moves the focus to a table, which shows a ring as if the Tab key had led there.
  const calm = () => {
    document.querySelector(".rp-reached")?.classList.remove("rp-reached");
    reached()?.classList.add("rp-reached");
    document.activeElement?.addEventListener("blur", () => reached()?.classList.remove("rp-reached"), { once: true });
  };
  addEventListener("hashchange", calm);
  const target = reached();
  if (!target) return;
  calm();
  const keep = new ResizeObserver(() => target.scrollIntoView({ behavior: "instant" }));
  const stop = () => keep.disconnect();
  keep.observe(document.querySelector("article") ?? document.body);
  for (const act of ["wheel", "touchstart", "keydown", "pointerdown"]) addEventListener(act, stop, { once: true, passive: true });
  addEventListener("load", async () => {
    await window.MathJax?.startup?.promise;
    await document.fonts.ready;
    setTimeout(stop, 500); // ms: the last formulas have their height
  });
});

// From a disk a browser shows a file in place of the page. A script has the text of a table; others open beside it.
document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[download]");
  if (location.protocol !== "file:" || !/\.(tex|json|md|svg|png|pdf|py)$/.test(link?.pathname ?? "")) return;
  if (!/\/tables\/[^/]*$/.test(link.pathname)) { link.target = "_blank"; return; }
  event.preventDefault();
  window.rpFile = (text) => {
    const href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    Object.assign(document.createElement("a"), { href, download: link.pathname.split("/").pop() }).click();
  };
  document.head.append(Object.assign(document.createElement("script"), { src: `${link.href}.js` }));
});
