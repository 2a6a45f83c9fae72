// Controls for choosing a softness.

const WIDTHS = [1e-3, 0.3];
export const USUAL = { name: "preset", squared: false, first: 0.03, last: 0.002 };

/** What a softness is called on the page. */
export const titled = (name) => (name === "preset" ? "Best known" : name.replace("learned:", "").replaceAll("_", " "));

/** Fills a select with all softnesses; `names` is { preset, families, learned }. */
export function fill(select, { preset, families, learned }) {
  const options = (names) => names.map((name) => new Option(titled(name), name));
  const group = (label, names) => {
    const element = Object.assign(document.createElement("optgroup"), { label });
    element.append(...options(names));
    return element;
  };
  select.append(...options(preset), group("Families", families), group("Learned", learned));
}

/** A fieldset with name, widths and squaring. `changed` is called after every change. */
export class SoftnessPicker {
  constructor(fieldset, title, names, changed) {
    fieldset.innerHTML = `<legend>${title}</legend>
      <label>Curve <select></select></label>
      <label>First width <input type="range" min="0" max="1" step="any"><output></output></label>
      <label>Last width <input type="range" min="0" max="1" step="any"><output></output></label>
      <label class="check"><input type="checkbox"> Of the squared distance</label>
      <p class="hint"></p>`;
    this.select = fieldset.querySelector("select");
    fill(this.select, names);
    [this.first, this.last] = fieldset.querySelectorAll("input[type=range]");
    this.squared = fieldset.querySelector("input[type=checkbox]");
    this.hint = fieldset.querySelector(".hint");
    fieldset.addEventListener("input", () => {
      this.#show();
      changed();
    });
    this.value = USUAL;
  }

  get value() {
    const width = (range) => Number((WIDTHS[0] * (WIDTHS[1] / WIDTHS[0]) ** Number(range.value)).toPrecision(3));
    return { name: this.select.value, squared: this.squared.checked, first: width(this.first), last: width(this.last) };
  }

  set value({ name, squared, first, last }) {
    const place = (width) => Math.log(width / WIDTHS[0]) / Math.log(WIDTHS[1] / WIDTHS[0]);
    this.select.value = name;
    if (this.select.selectedIndex < 0) this.select.value = USUAL.name;
    Object.assign(this.squared, { checked: squared });
    Object.assign(this.first, { value: place(first) });
    Object.assign(this.last, { value: place(last) });
    this.#show();
  }

  /** Families have widths; what was learned has its own. */
  #show() {
    const isFamily = !/^(preset$|learned:)/.test(this.select.value);
    for (const input of [this.first, this.last, this.squared]) input.closest("label").hidden = !isFamily;
    for (const [range, width] of [[this.first, this.value.first], [this.last, this.value.last]]) {
      range.nextElementSibling.textContent = String(width);
      range.setAttribute("aria-valuetext", `${width} of half the image`);
    }
  }
}
