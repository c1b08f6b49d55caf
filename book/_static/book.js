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
