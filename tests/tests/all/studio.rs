//! The workbench: what it catalogues, whom it answers, and what a browser makes of it.

use crate::pages::{NINE_POINTS, run_of_nine_points};
use mapper_tests::{CampaignFile, mapper, mapper_command, pictures, python, scratch, shared_run};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};

/// The results of a run without its recording, as it lies on a disk with many.
fn copy_results(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for name in ["journal.jsonl", "points.json", "plan.json", "map.json", "campaign.yaml", "report.html"] {
        std::fs::copy(from.join(name), to.join(name)).unwrap();
    }
}

fn catalogue(db: &Path, more: &[&str]) -> Value {
    let arguments = ["history", "--db", db.to_str().unwrap(), "--json"];
    mapper(arguments.into_iter().chain(more.iter().copied())).exits(0).json()["catalogue"].take()
}

#[test]
fn files_on_disk_win_over_the_catalogue() {
    let (run, folder) = (run_of_nine_points(), scratch());
    let (runs, db) = (folder.path().join("runs"), folder.path().join("history.db"));
    copy_results(&run, &runs.join("a/turbo_a-20260102T030405Z"));
    copy_results(&run, &runs.join("b"));
    // A log that was imported has no journal; a run that a kill ended has no results; one has points that are none.
    copy_results(&run, &runs.join("log"));
    std::fs::remove_file(runs.join("log/journal.jsonl")).unwrap();
    copy_results(&run, &runs.join("killed"));
    std::fs::remove_file(runs.join("killed/points.json")).unwrap();
    let journal = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    std::fs::write(runs.join("killed/journal.jsonl"), journal.lines().next().unwrap()).unwrap();
    copy_results(&run, &runs.join("damaged"));
    std::fs::write(runs.join("damaged/points.json"), "{\"points\": [{}]}").unwrap();
    let index = ["--index", runs.to_str().unwrap()];
    let listed = catalogue(&db, &index);
    let row = |listed: &Value, folder: &str| {
        listed.as_array().unwrap().iter().find(|row| row["folder"] == folder).cloned().unwrap_or_default()
    };
    let points: Value = serde_json::from_slice(&std::fs::read(run.join("points.json")).unwrap()).unwrap();
    let points = points["points"].as_array().unwrap();
    let dated = row(&listed, "a/turbo_a-20260102T030405Z");
    assert_eq!(dated["started"], "2026-01-02 03:04:05 UTC");
    assert_eq!(
        [&dated["machine"], &dated["serial_number"], &dated["campaign"]],
        ["turbo_a", "TA-0001", "turbo_a"]
    );
    let counted: u64 = dated["points"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(counted, points.len() as u64);
    let widest = points.iter().filter(|point| point["verdict"] != "unusable");
    let widest =
        widest.map(|point| 0.5 * (point["eta_high"].as_f64().unwrap() - point["eta_low"].as_f64().unwrap()));
    assert_eq!(dated["worst_eta_half_width"].as_f64(), widest.max_by(f64::total_cmp));
    let endings = ["b", "log", "killed"].map(|folder| row(&listed, folder)["ending"]["code"].clone());
    assert_eq!(endings, ["completed".into(), Value::Null, Value::Null]);
    assert_eq!(
        ["b", "log", "killed"].map(|folder| row(&listed, folder)["has_journal"] == true),
        [true, false, true]
    );
    assert!(row(&listed, "damaged")["problem"].as_str().unwrap().contains("points.json"));
    // Words of the row find it, and only it.
    assert_eq!(catalogue(&db, &["--find", "TA-0001 UNFINISHED"]).as_array().unwrap().len(), 1);
    assert_eq!(catalogue(&db, &["--find", "100%"]).as_array().unwrap().len(), 0);

    // One folder is repaired, one is gone, a new one links out of the directory.
    std::fs::copy(run.join("points.json"), runs.join("damaged/points.json")).unwrap();
    std::fs::remove_dir_all(runs.join("b")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&run, runs.join("link")).unwrap();
    let listed = catalogue(&db, &index);
    assert_eq!(
        [&row(&listed, "damaged")["problem"], &row(&listed, "damaged")["ending"]["code"]],
        [&Value::Null, &"completed".into()]
    );
    assert_eq!([row(&listed, "b"), row(&listed, "link")], [Value::Null, Value::Null]);
    // A directory that cannot be read, as of a disk that is not mounted, empties nothing.
    let gone = runs.with_extension("gone");
    assert!(
        mapper(["history", "--db", db.to_str().unwrap(), "--index", gone.to_str().unwrap()]).code != Some(0)
    );
    assert_eq!(catalogue(&db, &[]).as_array().unwrap().len(), 4);
}

/// The workbench with its address and token.
struct Served {
    program: Child,
    address: String,
    token: String,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn served(runs: &Path) -> Served {
    let mut command = mapper_command(["studio", runs.to_str().unwrap(), "--address", "127.0.0.1:0"]);
    let mut program = command.stderr(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(program.stderr.take().unwrap()).lines().map_while(Result::ok);
    let line = lines.into_iter().find(|line| line.starts_with("studio: ")).unwrap();
    let (address, token) = line.trim_start_matches("studio: http://").split_once("/#token=").unwrap();
    Served { address: address.to_owned(), token: token.to_owned(), program }
}

impl Served {
    /// Status and whole answer to a request with these lines in its head.
    fn ask(&self, request: &str, head: &[String], body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let head: String = head.iter().map(|line| format!("{line}\r\n")).collect();
        let text = format!("{request} HTTP/1.1\r\n{head}Content-Length: {}\r\n\r\n{body}", body.len());
        // A server that refuses by the head may close before it has read the rest.
        let _ = stream.write_all(text.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        (answer.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0), answer)
    }

    fn host(&self) -> String {
        format!("Host: {}", self.address)
    }

    fn origin(&self) -> String {
        format!("Origin: http://{}", self.address)
    }

    fn bearer(&self) -> String {
        format!("Authorization: Bearer {}", self.token)
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask(&format!("GET {path}"), &[self.host(), self.bearer()], "")
    }

    fn post(&self, path: &str, body: &str) -> (u16, String) {
        let form = "Content-Type: application/x-www-form-urlencoded".to_owned();
        self.ask(&format!("POST {path}"), &[self.host(), self.origin(), self.bearer(), form], body)
    }
}

#[test]
fn a_page_needs_the_token_and_no_path_leaves_the_directory() {
    let (run, folder) = (run_of_nine_points(), scratch());
    let runs = folder.path().join("runs");
    let hostile = "<script>alert(1)</script>";
    copy_results(&run, &runs.join("a"));
    copy_results(&run, &runs.join(hostile));
    std::fs::write(folder.path().join("secret.csv"), "secret").unwrap();
    let studio = served(&runs);
    let (host, origin, bearer) = (studio.host(), studio.origin(), studio.bearer());
    let (status, page) = studio.get("/");
    assert_eq!(status, 200, "{page}");
    assert!(page.contains("2 runs.") && page.contains("&lt;script&gt;alert(1)") && !page.contains(hostile));
    // The numbers of the rows.
    let ids: Vec<&str> =
        page.split("data-run=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    let id = ids[0];

    for (what, request, head, statuses) in [
        ("no token", "GET /", vec![host.clone()], [401, 401]),
        ("another token", "GET /", vec![host.clone(), format!("{bearer}0")], [401, 401]),
        ("no token for a file", "GET /file?run=1&name=points.json", vec![host.clone()], [401, 401]),
        ("another name", "GET /", vec!["Host: evil.example".into(), bearer.clone()], [403, 403]),
        ("no name", "GET /", vec![bearer.clone()], [400, 403]),
        (
            "another page's eyes",
            "GET /",
            vec![host.clone(), bearer.clone(), "Origin: http://evil.example".into()],
            [403, 403],
        ),
        (
            "another page's button",
            "POST /index",
            vec![host.clone(), bearer.clone(), "Origin: null".into()],
            [403, 403],
        ),
        ("a button of no page", "POST /index", vec![host.clone(), bearer.clone()], [403, 403]),
        ("a button without the token", "POST /index", vec![host.clone(), origin.clone()], [403, 403]),
        (
            "another page's sign-in",
            "POST /session",
            vec![host.clone(), "Origin: http://evil.example".into()],
            [403, 403],
        ),
        ("another method", "PUT /", vec![host.clone(), origin.clone(), bearer.clone()], [405, 405]),
        ("another page", "GET /etc/passwd", vec![host.clone(), bearer.clone()], [404, 404]),
        ("a way up", "GET /../secret.csv", vec![host.clone(), bearer.clone()], [400, 404]),
    ] {
        let (status, answer) = studio.ask(request, &head, "");
        assert!(statuses.contains(&status), "{what}: {status} {answer}");
        assert!(!answer.contains("turbo_a") && !answer.contains("secret"), "{what}: {answer}");
    }
    // The token is exchanged for a cookie that no other page sends and no script reads.
    let form = "Content-Type: application/x-www-form-urlencoded".to_owned();
    let sign_in = |token: &str| {
        studio.ask("POST /session", &[host.clone(), origin.clone(), form.clone()], &format!("token={token}"))
    };
    assert_eq!(sign_in("0123").0, 401);
    let (status, answer) = sign_in(&studio.token);
    let cookie = answer.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    assert!(status == 303 && cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"));
    let cookie = format!("Cookie: {}", cookie.split(';').next().unwrap());
    assert_eq!(studio.ask("GET /", &[host.clone(), cookie.clone()], "").0, 200);
    let foreign = [host.clone(), cookie, "Origin: http://evil.example".to_owned()];
    assert_eq!(studio.ask("POST /index", &foreign, "").0, 403);

    for name in
        ["../secret.csv", "..%2Fsecret.csv", "%2Fetc%2Fpasswd", "recording.mcap", "", "points.json%00"]
    {
        let (status, answer) = studio.get(&format!("/file?run={id}&name={name}"));
        assert!(status == 404 && !answer.contains("secret\n"), "{name}: {answer}");
    }
    for run in ["../..", "-1", "99999999999999999999", "1 OR 1=1", "", "7777"] {
        let run = run.replace(' ', "%20");
        assert_eq!(studio.get(&format!("/run?run={run}")).0, 404, "{run}");
    }
    // A row whose folder has become a link out of the directory.
    #[cfg(unix)]
    {
        let linked = page.split(&format!("data-run=\"{id}\"")).nth(1).unwrap();
        let name = if linked.split("choose ").nth(1).unwrap().starts_with('a') { "a" } else { hostile };
        std::fs::remove_dir_all(runs.join(name)).unwrap();
        std::os::unix::fs::symlink(&run, runs.join(name)).unwrap();
        assert_eq!(studio.get(&format!("/file?run={id}&name=points.json")).0, 422);
        assert_eq!(studio.get(&format!("/export?run={id}&format=csv")).0, 422);
        std::fs::remove_file(runs.join(name)).unwrap();
        copy_results(&run, &runs.join(name));
    }
    // What others wrote gets neither origin nor cookie; a map leaves in every format that is written.
    let (_, report) = studio.get(&format!("/file?run={id}&name=report.html"));
    assert!(report.contains("content-security-policy: sandbox allow-scripts\r\n"), "{}", &report[..400]);
    let (status, csv) = studio.get(&format!("/export?run={id}&format=csv"));
    assert!(status == 200 && csv.contains("attachment; filename=\"map.csv\""), "{csv}");
    assert_eq!(studio.get(&format!("/export?run={id}&format=exe")).0, 422);

    // Tags and a comment are kept as text and found; more than a form may have is refused.
    let (status, _) = studio
        .post("/note", &format!("run={id}&tags=Cold%2C+%3Cb%3E&comment=%3Cimg+src%3Dx%3E+after+rework"));
    assert_eq!(status, 303);
    let (_, found) = studio.get("/?words=rework&tag=cold");
    assert!(
        found.contains("1 of 2 runs.") && found.contains("&lt;img src=x&gt;") && !found.contains("<img"),
        "{found}"
    );
    assert_eq!(studio.post("/note", &format!("run={id}&comment={}", "x".repeat(100_000))).0, 413);
    let long = studio.ask("GET /", &[host.clone(), bearer.clone(), format!("X: {}", "x".repeat(20_000))], "");
    assert_eq!(long.0, 431);
    assert_eq!(studio.get("/?skip=999999999999&words=%27%22%25%5F").0, 200);

    // Equal runs do not differ; a run alone is compared with nothing.
    let (status, compared) = studio.get(&format!("/compare?run={}&run={}", ids[0], ids[1]));
    assert!(status == 200 && compared.matches("<svg").count() == 1, "{compared}");
    assert!(!compared.contains(hostile));
    assert_eq!(studio.get(&format!("/compare?run={id}")).0, 404);
    assert_eq!(studio.get(&format!("/compare?{}", format!("run={id}&").repeat(7))).0, 404);
}

#[test]
#[cfg_attr(
    not(all(with_chromium, with_python)),
    ignore = "needs Chromium and Python: run `cargo xtask test`"
)]
fn a_browser_finds_tags_and_compares_runs() {
    let Some(chromium) = option_env!("MAPPER_TEST_CHROMIUM") else {
        panic!("needs Chromium: run `cargo xtask test`")
    };
    let (run, folder) = (run_of_nine_points(), scratch());
    // The other machine takes five percent more flow.
    let effect: &[_] =
        &[("backend:\n  virtual_lab: {}", "backend:\n  virtual_lab: {effects: {flow_map_scale: 1.05}}")];
    let replacements: Vec<_> = NINE_POINTS.iter().chain(effect).copied().collect();
    let other = shared_run(&CampaignFile::shipped_with(&replacements)).run;
    let runs = folder.path().join("runs");
    copy_results(&run, &runs.join("before"));
    copy_results(&other, &runs.join("after"));
    copy_results(&run, &runs.join("third"));
    let pictures = pictures("studio");
    let studio = served(&runs);
    let url = format!("http://{}/#token={}", studio.address, studio.token);
    let seen = python("browse_studio.py", [chromium.as_ref(), pictures.as_os_str(), url.as_ref()]);
    assert_eq!([&seen["console"], &seen["serious"], &seen["elsewhere"]], [&serde_json::json!([]); 3]);
    assert_eq!([&seen["listed"], &seen["found"], &seen["tagged"]], [3, 1, 1]);
    assert_eq!(seen["address_has_token"], false);
    assert!(seen["empty"].as_str().unwrap().contains("No run has all of that"));
    assert_eq!(seen["comment"], "after the rework");
    assert_eq!(seen["by_keyboard"], true);
    // What differs most comes first: the run with the planted effect, and of each run the lines.
    let shares: Vec<Vec<f64>> = serde_json::from_value(seen["shares"].clone()).unwrap();
    assert!(shares.len() == 2 && shares.iter().all(|lines| lines.is_sorted_by(|a, b| a >= b)), "{shares:?}");
    assert!(shares[0][0] > 50.0 && shares[0][0] >= shares[1][0], "{shares:?}");
    assert_eq!(seen["legend"], serde_json::json!([true, true, true]), "each run is in the legend");
    assert!(seen["downloaded"].as_str().unwrap().ends_with(".csv"));
    for size in ["1400_light", "390_dark"] {
        assert_eq!(
            seen[format!("overflow_{size}")],
            serde_json::json!([0, 0, 0]),
            "{size}: a page is wider than the screen"
        );
    }
}
