"use strict";
/* The film: a canvas that shows one frame of one sheet. Without this script the page has a still. */
(function () {
  const film = document.getElementById("film");
  const find = (selector) => film.querySelector(selector);
  const canvas = find("canvas"), slider = find("input[type=range]"), play = find("button");
  const now = find(".now"), still = find(".still"), times = JSON.parse(film.dataset.times);
  const columns = Number(film.dataset.columns), pause = Math.min(300, Math.max(40, 10000 / times.length));
  const choices = Array.from(film.querySelectorAll("input[type=radio]"));
  const context = canvas.getContext("2d");
  const sheets = new Map();
  let timer = null;

  function draw() {
    const k = Number(slider.value), choice = choices.find((c) => c.checked);
    const sheet = sheets.get(choice.value);
    const words = choice.dataset.label + " at t = " + times[k];
    slider.setAttribute("aria-valuetext", "t = " + times[k]);
    for (const scale of film.querySelectorAll(".scale")) {
      scale.hidden = scale.dataset.of !== choice.value;
    }
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
    film.dataset.shown = choice.value + " " + k;
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

  for (const choice of choices) {
    const sheet = new Image();
    sheets.set(choice.value, sheet);
    sheet.addEventListener("load", draw);
    sheet.src = choice.dataset.sheet;
    choice.addEventListener("change", draw);
  }
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
