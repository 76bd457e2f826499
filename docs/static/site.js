// Buttons that copy a block of code, and the names of columns for tables that stack on a phone.
"use strict";

/** The commands of a session with prompts; without prompts all of it. */
function commandsOf(text) {
  const commands = text.split("\n").filter((line) => line.startsWith("$ "));
  return commands.length ? commands.map((line) => line.slice(2)).join("\n") : text.trimEnd();
}

function addCopyButtons() {
  if (!navigator.clipboard) return; // without https there is none
  for (const block of document.querySelectorAll("article div.highlight")) {
    const pre = block.querySelector("pre");
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copy";
    button.textContent = "copy";
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(commandsOf(pre.textContent));
      button.textContent = "copied";
      setTimeout(() => (button.textContent = "copy"), 1500);
    });
    block.append(button);
  }
}

function nameCells() {
  for (const table of document.querySelectorAll("article table.docutils")) {
    const names = [...table.querySelectorAll("thead th")].map((cell) => cell.textContent.trim());
    table.classList.add("stacks");
    for (const row of table.querySelectorAll("tbody tr")) {
      [...row.cells].forEach((cell, column) => {
        if (names[column]) cell.dataset.column = names[column];
      });
    }
  }
}

document.addEventListener("DOMContentLoaded", () => {
  nameCells();
  addCopyButtons();
});
