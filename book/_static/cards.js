// A card on every link to a printed number, an equation, a figure, a symbol, an erratum or a
// reference: the link carries the sign (book/_ext/cards.py), this shows the card on hover, focus
// and tap. Without it the link leads there.
(() => {
  const root = document.documentElement.dataset.content_root || "./";
  const DELAY = 350; // ms: a pointer that only passes by opens nothing
  const scripts = {};
  let shown, timer, dismissed;

  // A script is all that a page from a disk may load beside itself: one for each page with anchors.
  const pageOf = (link) => {
    const start = new URL(root, location.href).href.replace(/[^/]*$/, "");
    const place = new URL(link.getAttribute("href"), location.href).href;
    return place.slice(start.length).split(/\.html|#/)[0] || "index";
  };
  const load = (page) => scripts[page] ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = `${root}cards/${page}.js`;
    script.onload = () => resolve(window.rpCards[page]);
    script.onerror = reject;
    document.head.append(script);
  });

  const box = document.createElement("div");
  box.className = "rp-card";
  box.popover = "auto";
  box.setAttribute("role", "dialog");

  const close = () => { clearTimeout(timer); if (shown) box.hidePopover(); };

  const place = (link) => {
    if (matchMedia("(max-width: 600px)").matches) { box.style.cssText = ""; return; } // a sheet at the foot
    const at = link.getBoundingClientRect(), size = box.getBoundingClientRect();
    const wide = document.documentElement.clientWidth - 8, high = innerHeight - 8;
    const below = at.bottom + 6 + size.height < high, above = at.top - 6 - size.height > 8;
    // Where there is room neither below nor above it stands beside the link, which stays in sight.
    const top = below ? at.bottom + 6 : above ? at.top - 6 - size.height : high - size.height;
    const beside = at.right + 6 + size.width < wide ? at.right + 6 : at.left - 6 - size.width;
    box.style.top = `${Math.max(8, top)}px`;
    box.style.left = `${Math.max(8, Math.min(below || above ? at.left : beside, wide - size.width))}px`;
  };

  const keyOf = (link) => {
    const [page, name] = link.getAttribute("href").split("#");
    return page.endsWith("bibliography.html") ? `bibliography-${name}` : name;
  };

  // The Tab key stops once in a card and goes on to the next number; an arrow makes all of it reachable.
  const reach = (yes) => {
    const [, ...more] = box.querySelectorAll("summary, a, button, [tabindex]");
    for (const one of more) yes ? one.removeAttribute("tabindex") : one.tabIndex = -1;
  };

  // The address of the published book, or of this server. A path on a disk leads nowhere else: words and anchor.
  const addressOf = ({ link, words }) => {
    if (link.startsWith("https:")) return link;
    const url = new URL(root + link, location.href);
    return url.protocol === "file:" ? `${words}: goto.html${url.hash}` : url.href;
  };

  const open = async (link) => {
    const { cards, records } = await load(pageOf(link));
    const html = cards[keyOf(link)];
    if (!html || shown === link) return;
    close();
    // The browser's own tooltip would lie over the card.
    const told = link.querySelector("title");
    if (told) { link.setAttribute("aria-label", told.textContent); told.remove(); }
    link.removeAttribute("title");
    box.innerHTML = html;
    box.setAttribute("aria-label", `About ${link.ariaLabel || link.textContent.trim() || keyOf(link)}`);
    for (const one of box.querySelectorAll("a[href]")) one.href = root + one.getAttribute("href");
    for (const one of box.querySelectorAll("img")) one.src = root + one.dataset.src;
    for (const one of box.querySelectorAll("[data-record]")) one.dataset.copy = JSON.stringify(records[one.dataset.record], null, 2);
    for (const one of box.querySelectorAll("[data-link]")) one.dataset.copy = addressOf(one.dataset);
    reach(false);
    (link.closest("svg") ?? link).after(box);
    box.showPopover();
    shown = link;
    place(link);
    await window.MathJax?.typesetPromise?.([box]);
    place(link);
  };

  // A table or a list is one stop of the Tab key. The arrow keys lead from number to number.
  const GROUP = ":is(table, ul, ol, dl)";
  const linksOf = (group) => [...group.querySelectorAll("a.rp-has-card")].filter((one) => !box.contains(one));
  const groupOf = (link) => {
    let group = link?.closest(GROUP);
    for (let up = group; up; up = up.parentElement.closest(GROUP)) group = up;
    return group;
  };
  const rove = () => {
    for (const group of document.querySelectorAll(`article ${GROUP}`)) {
      const links = linksOf(group), first = links.find((one) => one.checkVisibility()) ?? links[0];
      for (const one of links) one === first ? one.removeAttribute("tabindex") : one.tabIndex = -1;
    }
  };
  document.addEventListener("DOMContentLoaded", rove);
  // A filter or a sorted column changes the first number of a list.
  document.addEventListener("input", rove);
  document.addEventListener("click", (event) => { if (event.target.closest(".rp-sortable thead")) rove(); });

  const linkOf = (target) => target.closest?.("a.rp-has-card");
  const later = (action) => { clearTimeout(timer); timer = setTimeout(action, DELAY); };

  document.addEventListener("pointerover", (event) => {
    if (event.pointerType === "touch") return;
    const link = linkOf(event.target);
    if (link !== dismissed) dismissed = undefined; // a card put away stays away while the pointer rests
    if (link) { if (!dismissed) later(() => open(link)); }
    else if (event.target.closest(".rp-card")) clearTimeout(timer);
    else if (shown && !box.contains(document.activeElement) && document.activeElement !== shown) later(close);
    else if (!shown) clearTimeout(timer);
  });
  document.addEventListener("focusin", (event) => {
    const link = linkOf(event.target);
    if (link && event.target.matches(":focus-visible")) later(() => open(link));
    else if (!box.contains(event.target)) close();
  });
  document.addEventListener("click", async (event) => {
    const link = linkOf(event.target), button = event.target.closest(".rp-card [data-copy]");
    if (link && event.pointerType === "touch" && shown !== link) {
      event.preventDefault();
      open(link);
    } else if (button) {
      await copy(button.dataset.copy);
      button.classList.add("rp-done");
      setTimeout(() => button.classList.remove("rp-done"), 1500);
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") close();
    const at = linkOf(document.activeElement ?? document.body), step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const links = step && groupOf(at) ? linksOf(groupOf(at)) : [];
    const next = links[links.indexOf(at) + step];
    if (next) { event.preventDefault(); at.tabIndex = -1; next.tabIndex = 0; next.focus(); }
    if (event.key !== "ArrowDown" || !shown || document.activeElement !== shown) return;
    event.preventDefault(); // the arrow leads from the link into its card
    reach(true);
    box.querySelector("summary, button, a").focus();
  });
  // An unfolded part needs more room.
  box.addEventListener("toggle", (event) => { if (event.target !== box && shown) place(shown); }, true);
  box.addEventListener("toggle", (event) => {
    if (event.target !== box) return; if (event.newState === "closed") { dismissed = shown; shown = undefined; } });
  addEventListener("scroll", () => { if (shown && !box.matches(":hover") && !box.contains(document.activeElement)) close(); }, { passive: true });

  const copy = async (text) => {
    try { await navigator.clipboard.writeText(text); } catch {
      const area = Object.assign(document.createElement("textarea"), { value: text });
      box.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
  };
})();
