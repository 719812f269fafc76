// The wipe viewer is built from the pictures below it; without scripts those still show everything.
(() => {
  const viewer = document.querySelector(".viewer");
  const views = [...document.querySelectorAll(".view")];
  if (!viewer || !views.length) return;
  const find = (selector) => viewer.querySelector(selector);
  const [left, right] = [find("select.left"), find("select.right")];
  const wipe = find(".wipe");
  let current = 0;

  const picture = (arm) => [...views[current].querySelectorAll("img")].find((img) => img.dataset.arm === arm);
  const show = () => {
    for (const [select, image, tag] of [[left, ".over", ".tag.left"], [right, ".under", ".tag.right"]]) {
      const source = picture(select.value);
      find(image).src = source ? source.src : "";
      find(image).alt = source ? source.alt : "";
      find(tag).textContent = select.selectedOptions[0].textContent;
    }
    find(".current").textContent = `${views[current].dataset.name} (${current + 1} of ${views.length})`;
  };
  const go = (index) => { current = (index + views.length) % views.length; show(); };

  left.addEventListener("change", show);
  right.addEventListener("change", show);
  find(".previous").addEventListener("click", () => go(current - 1));
  find(".next").addEventListener("click", () => go(current + 1));
  find("input").addEventListener("input", (event) => wipe.style.setProperty("--cut", `${event.target.value}%`));
  views.forEach((view, index) => {
    const button = view.querySelector("button");
    button.hidden = false;
    button.addEventListener("click", () => { go(index); viewer.scrollIntoView({ block: "start" }); });
  });
  viewer.hidden = false;
  show();
})();
// Folded sections are printed open.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
