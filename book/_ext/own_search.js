// Results of the index of this book on the search page, before the results of Sphinx.
(function () {
  "use strict";
  const SHOWN = 12;
  // No page can be fetched from a disk: Sphinx would log an error for each summary.
  if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
  // Names are compared without case, repeated spaces, quotes, and with one kind of minus sign.
  const normal = (text) =>
    text.toLowerCase().replace(/[−–]/g, "-").replace(/["'“”]/g, "").replace(/\s+/g, " ").trim();

  // 0: main name; 1: other name; 2: start of a main name; 3: all words in the shown text.
  function rank(query, [, shown, own, others]) {
    if (own.some((name) => normal(name) === query)) return 0;
    if (others.some((name) => normal(name) === query)) return 1;
    if (query.length > 2 && own.some((name) => normal(name).startsWith(query))) return 2;
    const words = query.split(" "), text = ` ${normal(shown)} `;
    return words.every((word) => word.length > 1 && text.includes(word)) ? 3 : null;
  }

  function found(query) {
    const ranked = [];
    for (const entry of window.REPRODUCE_INDEX) {
      const place = rank(query, entry);
      if (place !== null) ranked.push([place, entry]);
    }
    return ranked.sort((a, b) => a[0] - b[0]).map(([, entry]) => entry);
  }

  function show() {
    const query = normal(new URLSearchParams(location.search).get("q") || "");
    const results = document.getElementById("search-results");
    if (!query || !results) return;
    const entries = found(query);
    if (!entries.length) return;
    const section = document.createElement("section");
    section.id = "rp-found";
    const heading = document.createElement("h2");
    heading.textContent = "Tables, equations and numbers";
    const list = document.createElement("ul");
    for (const [address, shown] of entries.slice(0, SHOWN)) {
      const link = document.createElement("a");
      link.href = address;
      link.textContent = shown;
      const item = document.createElement("li");
      item.append(link);
      list.append(item);
    }
    section.append(heading, list);
    if (entries.length > SHOWN) {
      const more = document.createElement("p");
      more.textContent = `${entries.length - SHOWN} more, not shown.`;
      section.append(more);
    }
    results.before(section);
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", show);
  else show();
})();
