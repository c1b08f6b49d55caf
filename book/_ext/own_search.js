// Results of the index of this book on the search page, before the results of Sphinx.
(function () {
  "use strict";
  const SHOWN = 12, own = document.currentScript?.src;
  // No page can be fetched from a disk: Sphinx would log an error for each summary.
  if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
  // Names are compared without case, repeated spaces, quotes, and with one kind of minus sign.
  const normal = (text) =>
    text.toLowerCase().replace(/[−–]/g, "-").replace(/["'“”]/g, "").replace(/\s+/g, " ").trim();

  // Words are compared without the ending of a plural or a verb, and letters without accents.
  const stem = (word) => (word.length > 4 ? word.replace(/(?:ies|es|s|ed|ing)$/, "") : word);
  const wordsOf = (text) =>
    normal(text).normalize("NFD").replace(/[\u0300-\u036f]/g, "").split(/[^\p{L}\p{N}.%-]+/u).filter(Boolean).map(stem);
  const COMMON = new Set("a an and are at by do does for from how i in is it many much of on or the to was what which with".split(" "));

  // A name comes before words: 0, main name; 1, other name; 2, start of a main name;
  // 3, part of the title; 4, words.
  function rank(query, words, [, shown, own, others, more]) {
    if (own.some((name) => normal(name) === query)) return [0];
    if (others.some((name) => normal(name) === query)) return [1];
    if (own.some((name) => `${normal(name)} `.startsWith(`${query} `))) return [2];
    if (!words.length) return null;
    if (` ${normal(shown)} `.includes(` ${query} `)) return [3, 0, more ? 0 : 1, shown.length];
    const title = wordsOf(shown), names = [...title, ...own.flatMap(wordsOf)];
    const body = new Set([...names, ...others.flatMap(wordsOf), ...wordsOf(more)]);
    if (!words.every((word) => body.has(word))) return null;
    // More of the words in names, then a shorter title.
    const named = words.filter((word) => names.includes(word)).length;
    return [4, words.length - named, more ? 0 : 1, title.length];
  }

  function found(query) {
    // Numbers are only in names: next to words they are left out.
    const ranked = [], all = wordsOf(query), words = all.filter((word) => /\p{L}/u.test(word) && !COMMON.has(word));
    for (const entry of window.REPRODUCE_INDEX) {
      const place = rank(query, words.length ? words : all, entry);
      if (place !== null) ranked.push([place, entry]);
    }
    const order = (a, b) => a.reduce((sign, value, at) => sign || value - (b[at] ?? 0), 0);
    return ranked.sort((a, b) => order(a[0], b[0])).map(([, entry]) => entry);
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
    heading.textContent = "Sections, tables, equations and numbers";
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

  // The index is loaded only for a query.
  function start() {
    if (window.REPRODUCE_INDEX) return show();
    if (!new URLSearchParams(location.search).get("q")) return;
    const index = document.createElement("script");
    index.src = new URL("search-index.js", own);
    index.onload = show;
    document.head.append(index);
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
