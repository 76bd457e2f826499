// How the search ranks: what builds, drives and mends a robot first, the internals last.
"use strict";

const FIRST = /^(tutorial\/|first-hour|wiring|boards|ros$)/;
const SYMPTOMS = "troubleshooting";
const LAST =
  /^(adr\/|project\/|architecture|benchmarks|reliability|causes|commissioning|control|wheel-faults|versions|hardware-test|first-change|testing|platformio)/;

// `var`: the theme's script declares it once more.
var Scorer = {
  // The first of a result is its page, the fifth its score.
  score: ([page, , , , score]) => {
    if (page === SYMPTOMS) return score + 25;
    return score + (FIRST.test(page) ? 20 : LAST.test(page) ? -1000 : 0);
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
