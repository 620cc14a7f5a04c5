/* What the search shows first: pages whose title has every word that was typed, then tasks, and
   evidence and explanation last. Sphinx reduces "install" and "installation" to one stem; the title
   is compared with the words as typed. */
var Scorer = {
  score: ([docname, title, anchor, descr, score]) => {
    const typed = new URLSearchParams(window.location.search).get("q") || "";
    const words = typed.toLowerCase().match(/[\w-]+/g) || [];
    const found = title.toLowerCase().match(/[\w-]+/g) || [];
    const whole = words.length && words.every((word) => found.includes(word) || found.includes(word + "s"));
    const task = /^(how-to|tutorials)\/(?!index$)/.test(docname);
    const aside = /^(reference\/evidence|explanation|project)\//.test(docname);
    return score + (whole ? 40 : 0) + (task ? 6 : 0) - (aside ? 6 : 0);
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
