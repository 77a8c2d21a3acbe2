// Figures that are drawn again. Nothing here knows an editor.

"use strict";

const { page } = require("./results");

/** Figures beside the text, each of an experiment of a file. */
class Figures {
  /**
   * @param {(title: string, closed: () => void) => { show(html: string): void, reveal(): void }} open a panel
   * @param {(uri: string, name: string) => Promise<{ figure?: string | null, text: string }>} draw what is in it
   */
  constructor(open, draw) {
    this.open = open;
    this.draw = draw;
    this.shown = new Map();
  }

  /** Shows what was drawn, in the panel of the experiment. */
  show(uri, name, answer) {
    const key = JSON.stringify([uri, name]);
    let figure = this.shown.get(key);
    if (figure) {
      figure.panel.reveal();
    } else {
      const panel = this.open(name, () => this.shown.delete(key));
      figure = { uri, name, panel, isBusy: false, isStale: false };
      this.shown.set(key, figure);
    }
    figure.panel.show(page(answer));
  }

  /** Draws all again, since any file may be used by any other. */
  async again() {
    await Promise.all([...this.shown.values()].map((figure) => this.redraw(figure)));
  }

  /** Once at a time: what changes meanwhile is drawn afterwards. */
  async redraw(figure) {
    figure.isStale = true;
    if (figure.isBusy) return;
    figure.isBusy = true;
    while (figure.isStale) {
      figure.isStale = false;
      const answer = await this.draw(figure.uri, figure.name).catch((error) => ({ text: String(error.message) }));
      if ([...this.shown.values()].includes(figure)) figure.panel.show(page(answer));
    }
    figure.isBusy = false;
  }
}

module.exports = { Figures };
