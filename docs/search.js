/* How the site's search ranks what it finds: headings first, attributes of Python classes last. */
var Scorer = {
  score: ([docname, title, anchor, descr, score, filename, kind]) =>
    score + ({ title: 10, object: -10 }[kind] || 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
