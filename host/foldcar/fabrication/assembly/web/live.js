// Sliders for the design's parameters: each asks the server for the car anew, first for a draft, which takes a moment, then
// for the checked car. One question is on its way at a time; meanwhile only the last values that were chosen wait.

export class Live {
  // data: {parameters, values, command}; good: the answer that the page began with; show: called with an answer.
  constructor(data, form, good, show) {
    Object.assign(this, { data, show, good, drafted: false, values: { ...data.values }, asking: false, waiting: false });
    this.told = form.querySelector(".told");
    this.command = form.querySelector(".command");
    this.errors = {};
    this.inputs = {};
    for (const one of data.parameters) this.add(form.querySelector(".parameters"), one);
    this.command.textContent = data.command;
  }

  add(list, { key, unit, help, least, most, step, options }) {
    const row = document.createElement("div"), error = document.createElement("p"), id = `live-${key}`;
    row.className = "parameter";
    error.className = "error";
    error.id = `${id}-error`;
    error.setAttribute("role", "status");
    const label = Object.assign(document.createElement("label"), { htmlFor: id, textContent: key, title: help });
    row.append(label, ...(options ? this.select(id, key, options) : this.slider(id, key, unit, least, most, step)), error);
    for (const input of row.querySelectorAll("input, select")) input.setAttribute("aria-describedby", error.id);
    list.append(row);
    this.errors[key] = error;
    this.inputs[key] = row.querySelectorAll("input, select");
  }

  // Sets a parameter's slider and its number, if there is one of that name.
  choose(key, value) {
    if (!this.inputs[key]) return;
    for (const input of this.inputs[key]) input.value = value;
    this.inputs[key][this.inputs[key].length - 1].dispatchEvent(new Event("change"));
  }

  slider(id, key, unit, least, most, step) {
    const slider = Object.assign(document.createElement("input"), { type: "range", id, min: least, max: most, step });
    const number = Object.assign(document.createElement("input"), { type: "number", min: least, max: most, step: "any" });
    number.setAttribute("aria-label", `${key} in ${unit}`);
    slider.value = number.value = this.values[key];
    slider.addEventListener("input", () => { number.value = slider.value; this.set(key, Number(slider.value)); });
    number.addEventListener("change", () => { slider.value = number.value; this.set(key, Number(number.value)); });
    return [slider, number, Object.assign(document.createElement("span"), { textContent: unit })];
  }

  select(id, key, options) {
    const select = Object.assign(document.createElement("select"), { id });
    for (const option of options) select.add(new Option(option, option));
    select.value = this.values[key];
    select.addEventListener("change", () => this.set(key, select.value));
    return [select];
  }

  set(key, value) {
    this.values[key] = value;
    if (this.asking) this.waiting = true;
    else this.ask();
  }

  async ask() {
    this.asking = true;
    do {
      this.waiting = false;
      const answer = await this.question("draft");
      this.tell(answer, true);
      if (!this.waiting && !answer.error) this.tell(await this.question("car"), false);
    } while (this.waiting);
    this.asking = false;
  }

  async question(path) {
    this.told.textContent = "Being computed and checked …";
    const sent = { method: "POST", headers: { "Content-Type": "application/json", "X-Foldcar-Token": document.querySelector("meta[name=foldcar-token]").content }, body: JSON.stringify(this.values) };
    try {
      return await (await fetch(path, sent)).json();
    } catch (error) {
      return { error: "foldcar view --live does not answer; was it stopped?", parameter: null };
    }
  }

  // An answer to values that are not the last ones any more is no news, but for drafts, which follow the slider.
  tell(answer, draft) {
    if (this.waiting && !(draft && !answer.error)) return;
    for (const error of Object.values(this.errors)) error.textContent = "";
    document.body.dataset.error = answer.error || "";
    if (answer.error) {
      const beside = this.errors[answer.parameter];
      if (beside) beside.textContent = answer.error;
      this.told.textContent = `${beside ? "" : `${answer.error}. `}The last car that can be built stays.`;
      if (this.drafted) this.use(this.good);
      this.drafted = false;
      return;
    }
    this.drafted = draft;
    if (!draft) {
      this.good = answer;
      this.told.textContent = "";
    }
    this.use(answer);
  }

  use(answer) {
    this.command.textContent = answer.command;
    this.show(answer);
  }
}
