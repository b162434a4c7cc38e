"use strict";
// Shows one page at a time, keeps the answers in the browser, saves them as a file and reads them back.
(() => {
const about = JSON.parse(document.getElementById("about").textContent);
const store = `insonify study ${about.study}`;
const byId = (id) => document.getElementById(id);
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const pages = all("main > .page");
let answers = fresh();
let page = 0;

// The order of the keys is that of the file: its checksum is over the text.
function fresh() {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  return {
    response: [...bytes].map((b) => b.toString(16).padStart(2, "0")).join(""),
    saved: "",
    assessor: { name: "", experience: "" },
    cases: about.images.map(() => ({ image: null, agreement: null, remark: "" })),
    rankings: about.rankings.map((cases) => ({ cases: [...cases], ranks: cases.map(() => null) })),
    remark: "",
  };
}

// Answers of this study made of what a file or the browser holds; throws where they do not fit.
function fitting(found) {
  const text = (value) => {
    if (typeof value !== "string") throw new Error("a text is missing");
    return value;
  };
  const number = (value, most) => {
    if (value === null || (Number.isInteger(value) && value >= 1 && value <= most)) return value;
    throw new Error(`${value} is not one of the answers`);
  };
  const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
  if (!found || !Array.isArray(found.cases) || found.cases.length !== about.images.length) throw new Error("the cases are not those of this form");
  if (!Array.isArray(found.rankings) || !same(found.rankings.map((r) => r.cases), about.rankings)) throw new Error("the comparisons are not those of this form");
  return {
    response: text(found.response),
    saved: text(found.saved),
    assessor: { name: text(found.assessor.name), experience: text(found.assessor.experience) },
    cases: found.cases.map((c, i) => {
      const image = number(c.image, about.images[i]);
      const agreement = number(c.agreement, 5);
      if (image === null && agreement !== null) throw new Error(`case ${i + 1} rates no image`);
      return { image, agreement, remark: text(c.remark) };
    }),
    rankings: found.rankings.map((r) => {
      const ranks = r.cases.map((_, i) => number(r.ranks[i], r.cases.length));
      const given = ranks.filter((rank) => rank !== null);
      if (new Set(given).size !== given.length) throw new Error("a rank is given twice");
      return { cases: [...r.cases], ranks };
    }),
    remark: text(found.remark),
  };
}

// CRC-32 of a text in UTF-8, as in zip.
function crc32(text) {
  let crc = 0xffffffff;
  for (const byte of new TextEncoder().encode(text)) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return (~crc >>> 0).toString(16).padStart(8, "0");
}

function notice(text, bad = false) {
  byId("notice").textContent = text;
  byId("notice").classList.toggle("bad", bad);
}

function keep() {
  try {
    localStorage.setItem(store, JSON.stringify(answers));
  } catch {
    notice("This browser does not keep answers: save them as a file before you close the page.", true);
  }
}

function kept() {
  let text = null;
  try {
    text = localStorage.getItem(store);
  } catch {
    notice("This browser does not keep answers: save them as a file before you close the page.", true);
  }
  if (text === null) return;
  try {
    answers = fitting(JSON.parse(text));
    notice("Your answers are here again.");
  } catch (error) {
    notice(`What this browser kept cannot be read (${error.message}); load a saved file if you have one.`, true);
  }
}

const chosen = (n) => answers.cases[n - 1].image;
const imageOf = (n) => byId(`image-${n}-${chosen(n)}`);
const isOpen = (ranking) => ranking.cases.every((n) => chosen(n) !== null);
const isRanked = (ranking) => ranking.ranks.every((rank) => rank !== null);

function isDone(section) {
  if (section.dataset.case) {
    const { image, agreement } = answers.cases[section.dataset.case - 1];
    return image !== null && agreement !== null;
  }
  return section.dataset.ranking ? isRanked(answers.rankings[section.dataset.ranking - 1]) : false;
}

function nameOf(section) {
  if (section.dataset.case) return `Case ${section.dataset.case}`;
  if (section.dataset.ranking) return `Comparison ${section.dataset.ranking}`;
  return section.id === "start" ? "Start" : "Save";
}

// An image of another is another question: what was said of the first one goes.
function choose(n, image) {
  const said = answers.cases[n - 1];
  if (said.image === image) return;
  const ranking = answers.rankings.find((r) => r.cases.includes(n));
  const undone = said.agreement !== null || (ranking && ranking.ranks.some((rank) => rank !== null));
  said.image = image;
  said.agreement = null;
  if (ranking) ranking.ranks.fill(null);
  notice(undone ? "Another image: please rate it, and compare again where you had compared." : "");
  keep();
  draw();
}

function rank(ranking, n, value) {
  const place = ranking.cases.indexOf(n);
  const other = value === null ? -1 : ranking.ranks.indexOf(value);
  if (other >= 0 && other !== place) ranking.ranks[other] = ranking.ranks[place];
  ranking.ranks[place] = value;
  keep();
  draw();
}

// Shows the answers on every page.
function draw() {
  answers.cases.forEach((said, i) => {
    const n = i + 1;
    all(`input[name="image-${n}"]`).forEach((input) => { input.checked = Number(input.value) === said.image; });
    all(`input[name="agreement-${n}"]`).forEach((input) => { input.checked = Number(input.value) === said.agreement; });
    byId(`rating-${n}`).hidden = said.image === null;
    const shown = byId(`chosen-${n}`);
    if (said.image === null) shown.removeAttribute("src");
    else if (shown.getAttribute("src") !== imageOf(n).getAttribute("src")) shown.src = imageOf(n).src;
    shown.alt = said.image === null ? "" : `Image ${said.image}, which you chose`;
    if (byId(`remark-${n}`).value !== said.remark) byId(`remark-${n}`).value = said.remark;
  });
  answers.rankings.forEach((ranking, i) => {
    const section = byId(`ranking-${i + 1}`);
    const open = isOpen(ranking);
    const wanting = ranking.cases.filter((n) => chosen(n) === null);
    section.querySelector(".order").hidden = !open;
    section.querySelector(".locked").textContent = open ? "" : `This comparison opens when an image is chosen in case ${wanting.join(" and ")}.`;
    ranking.cases.forEach((n, place) => {
      const picture = section.querySelector(`img[data-case="${n}"]`);
      if (open) picture.src = imageOf(n).src;
      else picture.removeAttribute("src");
      section.querySelector(`select[data-case="${n}"]`).value = ranking.ranks[place] ?? "";
    });
  });
  for (const [id, value] of [["name", answers.assessor.name], ["experience", answers.assessor.experience], ["remark", answers.remark]]) {
    if (byId(id).value !== value) byId(id).value = value;
  }
  const asked = 2 * answers.cases.length + answers.rankings.length;
  const done = answers.cases.reduce((sum, c) => sum + (c.image !== null) + (c.agreement !== null), 0) + answers.rankings.filter(isRanked).length;
  byId("progress").max = asked;
  byId("progress").value = done;
  byId("progress-text").textContent = `${done} of ${asked} questions answered`;
  const open = pages.filter((section) => (section.dataset.case || section.dataset.ranking) && !isDone(section));
  byId("summary").textContent = open.length === 0 ? "All questions are answered. Thank you." : "These are not answered yet:";
  byId("open-questions").replaceChildren(...open.map((section) => {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = nameOf(section);
    button.addEventListener("click", () => show(pages.indexOf(section)));
    item.append(button);
    return item;
  }));
  all("#pages button").forEach((button, i) => {
    button.classList.toggle("done", isDone(pages[i]));
    button.setAttribute("aria-label", nameOf(pages[i]) + (isDone(pages[i]) ? ", answered" : ""));
    if (i === page) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  });
}

function show(index) {
  page = Math.max(0, Math.min(pages.length - 1, index));
  pages.forEach((section, i) => { section.hidden = i !== page; });
  byId("back").disabled = page === 0;
  byId("next").disabled = page === pages.length - 1;
  notice("");
  draw();
  document.querySelector("main").scrollTop = 0;
  pages[page].querySelector("h2").focus({ preventScroll: true });
}

// The image stands far above its question: the first Next leads there.
function next() {
  const section = pages[page];
  const n = section.dataset.case;
  const rating = n && byId(`rating-${n}`);
  if (n && chosen(n) !== null && answers.cases[n - 1].agreement === null && !rating.dataset.asked) {
    rating.dataset.asked = "yes";
    rating.scrollIntoView({ block: "center" });
    rating.querySelector("input").focus({ preventScroll: true });
    notice("How far do you agree? Next once more leaves it open.");
    return;
  }
  show(page + 1);
}

// One image on the whole screen: the images of a case, or those of a comparison.
const large = { list: [], at: 0, caseNumber: null };

function enlarge(button) {
  const section = button.closest(".page");
  large.list = all(".enlarge", section);
  large.caseNumber = section.dataset.case ? Number(section.dataset.case) : null;
  byId("large").showModal();
  turn(large.list.indexOf(button));
  byId(large.caseNumber ? "large-choose" : "large-next").focus();
}

function turn(index) {
  large.at = (index + large.list.length) % large.list.length;
  const picture = large.list[large.at].querySelector("img");
  byId("large-image").src = picture.src;
  byId("large-image").alt = picture.alt;
  byId("large-name").textContent = picture.alt;
  byId("large-choose").hidden = large.caseNumber === null;
}

function save() {
  answers.saved = new Date().toISOString();
  keep();
  const content = answers;
  const file = { format: about.format, version: about.version, study: about.study, checksum: crc32(JSON.stringify(content)), content };
  const blob = new Blob([JSON.stringify(file, null, 1) + "\n"], { type: "application/json" });
  const link = document.createElement("a");
  const name = answers.assessor.name.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || answers.response.slice(0, 6);
  link.href = URL.createObjectURL(blob);
  link.download = `answers-${about.study.slice(0, 6)}-${name}.json`;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  notice(`Saved as ${link.download}, where this browser puts downloads.`);
}

async function load(input) {
  const [file] = input.files;
  input.value = "";
  if (!file) return;
  try {
    const found = JSON.parse(await file.text());
    if (found.format !== about.format) throw new Error("it is no file of answers");
    if (found.version !== about.version) throw new Error("it is of another version");
    if (found.study !== about.study) throw new Error("it belongs to another study");
    if (found.checksum !== crc32(JSON.stringify(found.content))) throw new Error("it was changed after it was saved");
    const loaded = fitting(found.content);
    const begun = answers.cases.some((c) => c.image !== null);
    if (begun && !confirm("Replace the answers on this page by those of the file?")) return;
    answers = loaded;
    keep();
    draw();
    notice("The answers of the file are here.");
  } catch (error) {
    notice(`${file.name} was not loaded: ${error.message}. Your answers are as they were.`, true);
  }
}

// JSON cannot hold half a character.
const whole = (text) => text.replace(/[\ud800-\udbff](?![\udc00-\udfff])|(?<![\ud800-\udbff])[\udc00-\udfff]/g, "\ufffd");

document.addEventListener("change", (event) => {
  const { target } = event;
  const [, kind, n] = /^(image|agreement)-(\d+)$/.exec(target.name ?? "") ?? [];
  if (kind === "image") choose(Number(n), Number(target.value));
  if (kind === "agreement") {
    answers.cases[n - 1].agreement = Number(target.value);
    notice("");
    keep();
    draw();
  }
  if (target.matches("select[data-ranking]")) {
    rank(answers.rankings[target.dataset.ranking - 1], Number(target.dataset.case), target.value === "" ? null : Number(target.value));
  }
  if (target.id === "load") load(target);
});
document.addEventListener("input", ({ target }) => {
  const remark = /^remark-(\d+)$/.exec(target.id);
  if (remark) answers.cases[remark[1] - 1].remark = whole(target.value);
  else if (target.id === "remark") answers.remark = whole(target.value);
  else if (target.id === "name" || target.id === "experience") answers.assessor[target.id] = whole(target.value);
  else return;
  keep();
});
document.addEventListener("click", ({ target }) => {
  const button = target.closest(".enlarge");
  if (button) enlarge(button);
});
byId("next").addEventListener("click", next);
byId("back").addEventListener("click", () => show(page - 1));
byId("save").addEventListener("click", save);
byId("anew").addEventListener("click", () => {
  if (!confirm("Forget all answers on this page and begin anew? Saved files stay.")) return;
  answers = fresh();
  all(".rating").forEach((rating) => { delete rating.dataset.asked; });
  keep();
  draw();
  notice("A new form, without answers.");
});
byId("large-previous").addEventListener("click", () => turn(large.at - 1));
byId("large-next").addEventListener("click", () => turn(large.at + 1));
byId("large-close").addEventListener("click", () => byId("large").close());
byId("large-choose").addEventListener("click", () => {
  choose(large.caseNumber, Number(large.list[large.at].dataset.image));
  byId("large").close();
});
byId("large").addEventListener("keydown", (event) => {
  if (event.key === "ArrowLeft") turn(large.at - 1);
  if (event.key === "ArrowRight") turn(large.at + 1);
});
// Another tab with the same form writes to the same place.
window.addEventListener("storage", (event) => {
  if (event.key === store) notice("This form is open in another tab, too: close one of them, or answers are lost.", true);
});

byId("pages").append(...pages.map((section, i) => {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = section.dataset.case ?? (section.dataset.ranking ? `C${section.dataset.ranking}` : nameOf(section));
  button.addEventListener("click", () => show(i));
  item.append(button);
  return item;
}));
show(0);
kept();
draw();
})();
