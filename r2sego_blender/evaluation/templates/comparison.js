// A wipe viewer of each comparison, built from the pictures below it; without scripts those still show everything.
document.querySelectorAll(".comparison").forEach((place) => {
  const viewer = place.querySelector(".viewer");
  const views = [...place.querySelectorAll(".view")];
  if (!viewer || !views.length) return;
  const find = (selector) => viewer.querySelector(selector);
  const [left, right, unseen] = [find("select.left"), find("select.right"), find("input.unseen")];
  const [wipe, slider, mask] = [find(".wipe"), find("input[type=range]"), find(".mask")];
  let current = 0;

  const picture = (arm) => [...views[current].querySelectorAll("img")].find((img) => img.dataset.arm === arm);
  const show = () => {
    for (const [select, image, tag, told] of [
      [left, ".over", ".tag.left", ".told .left"], [right, ".under", ".tag.right", ".told .right"],
    ]) {
      const source = picture(select.value);
      find(image).src = source ? source.src : "";
      find(image).alt = source ? source.alt : "";
      find(tag).textContent = select.selectedOptions[0].textContent;
      find(told).textContent = source ? source.closest("figure").querySelector("figcaption").textContent : "no picture";
    }
    const drawn = views[current].dataset.unseen;
    mask.hidden = !(unseen && unseen.checked && drawn);
    if (!mask.hidden) {
      mask.src = drawn;
      mask.alt = "What no capture saw";
    }
    find(".current").textContent = `${views[current].dataset.name} (${current + 1} of ${views.length})`;
  };
  const go = (index) => { current = (index + views.length) % views.length; show(); };
  const cut = () => {
    wipe.style.setProperty("--cut", `${slider.value}%`);
    slider.setAttribute("aria-valuetext", `${left.selectedOptions[0].textContent} ${slider.value} percent`);
  };

  for (const choice of [left, right, unseen].filter(Boolean)) choice.addEventListener("change", () => { show(); cut(); });
  find(".previous").addEventListener("click", () => go(current - 1));
  find(".next").addEventListener("click", () => go(current + 1));
  slider.addEventListener("input", cut);
  views.forEach((view, index) => {
    const button = view.querySelector("button");
    button.hidden = false;
    button.addEventListener("click", () => { go(index); viewer.scrollIntoView({ block: "start" }); slider.focus({ preventScroll: true }); });
  });
  viewer.hidden = false;
  show();
  cut();
});
// Folded sections are printed open.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
