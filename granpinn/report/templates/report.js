"use strict";
/* The film: a canvas that shows one frame of the sheet. Without this script the page has a still. */
(function () {
  const film = document.getElementById("film");
  const find = (selector) => film.querySelector(selector);
  const canvas = find("canvas"), slider = find("input[type=range]"), play = find("button");
  const now = find(".now"), still = find(".still"), times = JSON.parse(film.dataset.times);
  const columns = Number(film.dataset.columns), pause = Math.min(300, Math.max(40, 10000 / times.length));
  const context = canvas.getContext("2d"), sheet = new Image();
  let timer = null;

  function draw() {
    const k = Number(slider.value), words = "pressure at t = " + times[k];
    slider.setAttribute("aria-valuetext", "t = " + times[k]);
    if (!sheet.complete || sheet.naturalWidth === 0) {
      return;
    }
    const width = canvas.width, height = canvas.height;
    context.clearRect(0, 0, width, height);
    const left = (k % columns) * width, top = Math.floor(k / columns) * height;
    context.drawImage(sheet, left, top, width, height, 0, 0, width, height);
    now.textContent = words;
    canvas.setAttribute("aria-label", words);
    canvas.hidden = false;
    still.hidden = true;
    film.dataset.shown = k;
  }

  function stop() {
    clearInterval(timer);
    timer = null;
    play.textContent = "Play";
    now.setAttribute("aria-live", "polite");
  }

  function step() {
    slider.value = (Number(slider.value) + 1) % times.length;
    draw();
  }

  sheet.addEventListener("load", draw);
  sheet.src = film.dataset.sheet;
  slider.addEventListener("input", function () { stop(); draw(); });
  play.addEventListener("click", function () {
    if (timer !== null) {
      stop();
      return;
    }
    timer = setInterval(step, pause);
    play.textContent = "Pause";
    now.setAttribute("aria-live", "off"); /* no listener follows so many times */
  });
  window.addEventListener("beforeprint", stop);
  find(".controls").hidden = false;
  draw();
})();
