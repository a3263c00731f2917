"use strict";
(() => {
  // Downloads of a picture as it stands on the page: as SVG, or drawn into a PNG; both at print size, 132 mm across.
  const WIDTH_MM = 132.08, DOTS_PER_INCH = 600, MM_PER_INCH = 25.4;

  const drawing = (figure) => {
    const copy = figure.querySelector("svg").cloneNode(true), box = copy.viewBox.baseVal;
    copy.setAttribute("width", `${WIDTH_MM}mm`);
    copy.setAttribute("height", `${(WIDTH_MM * box.height) / box.width}mm`);
    const style = document.createElementNS(copy.namespaceURI, "style");
    style.textContent = document.querySelector("[data-style]").dataset.style + ":root{background:#fff}";
    copy.prepend(style);
    return { text: new XMLSerializer().serializeToString(copy), ratio: box.height / box.width };
  };

  const save = (blob, name) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };

  const kinds = {
    svg: (made, name) => save(new Blob([made.text], { type: "image/svg+xml" }), name),
    png: (made, name) => {
      const image = new Image(), canvas = document.createElement("canvas");
      canvas.width = Math.round((WIDTH_MM / MM_PER_INCH) * DOTS_PER_INCH);
      canvas.height = Math.round(canvas.width * made.ratio);
      image.onload = () => {
        const pen = canvas.getContext("2d");
        pen.fillStyle = "#fff";
        pen.fillRect(0, 0, canvas.width, canvas.height);
        pen.drawImage(image, 0, 0, canvas.width, canvas.height);
        canvas.toBlob((blob) => save(blob, name), "image/png");
      };
      image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(made.text)}`;
    },
  };

  document.querySelectorAll(".downloads").forEach((one) => {
    one.hidden = false;
    one.querySelectorAll("button").forEach((button) => button.addEventListener("click", () => {
      const kind = button.dataset.kind;
      kinds[kind](drawing(one.closest("figure")), `${one.dataset.name}.${kind}`);
    }));
  });
})();
