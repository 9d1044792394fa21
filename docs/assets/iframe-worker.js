"use strict";
/* The search of the site, where it is opened from files: a browser starts no worker from a file.
   This Worker runs the script of the search in a hidden frame of the page, with the interface of a
   worker. The plugin `offline` of the theme asks for such a script, and for "iframe-worker" in its name. */
(function () {
  if (location.protocol !== "file:") {
    return;
  }

  function deliver(target, data) {
    target.dispatchEvent(new MessageEvent("message", { data }));
  }

  function load(inside, address) {
    return new Promise(function (loaded, failed) {
      const script = inside.document.createElement("script");
      script.addEventListener("load", loaded);
      script.addEventListener("error", () => failed(new Error("not loaded: " + address)));
      script.src = address;
      inside.document.body.append(script);
    });
  }

  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.srcdoc = "<!doctype html><body></body>";
      this.frame = frame;
      this.ready = new Promise((open) => frame.addEventListener("load", open, { once: true }))
        .then(() => this.start(new URL(address, location.href).href));
      document.body.append(frame);
    }

    start(address) {
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => deliver(this, data); // from the script to the page
      inside.importScripts = (...more) =>
        more.reduce((before, next) => before.then(() => load(inside, next)), Promise.resolve());
      return load(inside, address);
    }

    postMessage(data) {
      const copy = structuredClone(data); // a worker would get a copy too
      this.ready = this.ready.then(() => deliver(this.frame.contentWindow, copy));
    }

    terminate() {
      this.frame.remove();
    }
  };
})();
