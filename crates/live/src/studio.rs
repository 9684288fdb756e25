//! The workbench: pages of the runs below a directory. Each page is a call of the library and a page of its result.

use crate::access::{Access, guard};
use crate::live::{LiveError, token};
use crate::server::{Connections, serve};
use crate::tls::{TlsFiles, read};
use axum::Router;
use axum::extract::{DefaultBodyLimit, Form, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::from_fn_with_state;
use axum::response::{Html, IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use mapper_history::{CatalogueFilter, CataloguedRun, History};
use mapper_report::page::{RunList, compare_page, sign_in_page, studio_message, studio_run_page};
use mapper_session::{Registry, RunFolder, SessionError, compare_runs, index_runs};
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Runs on one page of the list.
const PAGE_RUNS: usize = 100;
/// Maximum number of compared runs: more lines cannot be told apart.
const MAX_COMPARED: usize = 6;
/// Maximum size of a form, bytes.
const MAX_FORM_BYTES: usize = 32 << 10;
/// Where the token is exchanged for a cookie: the only button without one.
const SIGN_IN: &str = "/session";

/// The workbench, which is served until the process ends.
pub struct Studio {
    url: String,
}

struct Bench {
    directory: PathBuf,
    registry: Registry,
    history: Mutex<History>,
    /// Folders that cannot be read, each with the reason.
    unreadable: Mutex<Vec<(String, String)>>,
    access: Arc<Access>,
}

impl Studio {
    /// Indexes the directory and serves its runs. Browsers need the token in the address, on this computer too.
    pub fn open(
        address: SocketAddr,
        tls: Option<&TlsFiles>,
        directory: PathBuf,
        mut history: History,
        registry: Registry,
    ) -> Result<Studio, LiveError> {
        let unreadable = index_runs(&directory, &mut history)?;
        let tls = tls.map(read).transpose()?;
        let listen = |source| LiveError::Listen(address, source);
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        let token = token()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let url = format!("{scheme}://{address}/#token={token}");
        let access = Arc::new(Access::new(address, Some(token), tls.is_some()).with_sign_in(SIGN_IN));
        let (history, unreadable) = (Mutex::new(history), Mutex::new(unreadable));
        let bench = Arc::new(Bench { directory, registry, history, unreadable, access });
        serve(listener, tls, router(bench), Arc::<Connections>::default()).map_err(listen)?;
        Ok(Studio { url })
    }

    /// URL of the first page. The token follows `#`, so that browsers never send it with the address.
    pub fn url(&self) -> &str {
        &self.url
    }
}

fn router(bench: Arc<Bench>) -> Router {
    let guarded = from_fn_with_state(bench.access.clone(), guard);
    // A form is in the body of a button's request, and in the query of any other.
    let page = |answer: Answer| {
        move |State(bench): State<Arc<Bench>>, headers: HeaderMap, Form(fields): Form<Fields>| async move {
            if !bench.access.has_token(&headers) {
                return sign_in_answer();
            }
            // On a thread that may take its time.
            match tokio::task::spawn_blocking(move || answer(&bench, &fields)).await {
                Ok(answer) => answer.unwrap_or_else(IntoResponse::into_response),
                Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
            }
        }
    };
    Router::new()
        .route("/", get(page(list)))
        .route("/run", get(page(run)))
        .route("/file", get(page(file)))
        .route("/export", get(page(export)))
        .route("/compare", get(page(compare)))
        .route("/note", post(page(note)))
        .route("/index", post(page(index)))
        .route(SIGN_IN, post(sign_in))
        .layer(DefaultBodyLimit::max(MAX_FORM_BYTES))
        .layer(guarded)
        .with_state(bench)
}

type Fields = Vec<(String, String)>;
type Answer = fn(&Bench, &Fields) -> Result<Response, Refusal>;

fn field<'a>(fields: &'a Fields, name: &str) -> Option<&'a str> {
    fields.iter().find(|(key, value)| key == name && !value.is_empty()).map(|(_, value)| value.as_str())
}

/// Shows nothing to those without the token but where to enter it.
fn sign_in_answer() -> Response {
    (StatusCode::UNAUTHORIZED, sign_in_page().map(Html).map_err(Refusal::from)).into_response()
}

async fn sign_in(State(bench): State<Arc<Bench>>, Form(fields): Form<Fields>) -> Response {
    match bench.access.cookie(field(&fields, "token").unwrap_or_default()) {
        Some(cookie) => ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response(),
        None => sign_in_answer(),
    }
}

/// Why a request has no page.
enum Refusal {
    /// The run, or its file, does not exist.
    Unknown(&'static str),
    Session(SessionError),
}

impl<E: Into<SessionError>> From<E> for Refusal {
    fn from(error: E) -> Self {
        Refusal::Session(error.into())
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let (status, message) = match self {
            Refusal::Unknown(message) => (StatusCode::NOT_FOUND, message.to_owned()),
            Refusal::Session(error) => (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()),
        };
        let page = studio_message("This does not work", &message).unwrap_or(message);
        (status, Html(page)).into_response()
    }
}

/// A thread that panicked while it held the lock left the value valid: changes of a history are transactions.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Bench {
    /// The folder of the run of this number.
    fn folder(&self, id: &str) -> Result<RunFolder, Refusal> {
        let row = id.parse().ok().map(|id| lock(&self.history).catalogued(id)).transpose()?.flatten();
        let row = row
            .ok_or(Refusal::Unknown("This run does not exist; it may have been moved. Look for new runs."))?;
        Ok(RunFolder::of(&self.directory, row)?)
    }

    fn chosen(&self, fields: &Fields) -> Result<RunFolder, Refusal> {
        self.folder(field(fields, "run").unwrap_or_default())
    }

    fn formats(&self) -> Vec<&'static str> {
        self.registry.formats.written().map(|format| format.name).collect()
    }
}

fn list(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let text = |name| field(fields, name).map(str::to_owned);
    let filter = CatalogueFilter {
        words: text("words").unwrap_or_default(),
        machine: text("machine"),
        tag: text("tag"),
        attention: field(fields, "attention").is_some(),
        skip: field(fields, "skip").and_then(|skip| skip.parse().ok()).unwrap_or(0),
        limit: PAGE_RUNS,
    };
    let history = lock(&bench.history);
    let (machines, tags) = history.catalogue_names()?;
    let list = RunList {
        directory: &bench.directory.display().to_string(),
        filter: &filter,
        page: &history.catalogue(&filter)?,
        machines: &machines,
        tags: &tags,
        unreadable: &lock(&bench.unreadable),
    };
    Ok(Html(list.page()?).into_response())
}

fn run(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let run = bench.chosen(fields)?;
    let files: Vec<String> = run.files().into_iter().collect();
    Ok(Html(studio_run_page(&run.run, run.is_run_now(), &files, &bench.formats())?).into_response())
}

/// A file of a run. It was written by others, so that a page in it has neither this page's origin nor its cookie.
fn file(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let name = field(fields, "name").unwrap_or_default();
    let content = bench.chosen(fields)?.file(name)?;
    let content = content.ok_or(Refusal::Unknown("The run has no such file."))?;
    let kind = match name.rsplit_once('.') {
        Some((_, "html")) => "text/html; charset=utf-8",
        Some((_, "svg")) => "image/svg+xml",
        Some((_, "json" | "md" | "csv" | "yaml" | "txt" | "map")) => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    };
    let headers = [(header::CONTENT_TYPE, kind), (header::CONTENT_SECURITY_POLICY, "sandbox allow-scripts")];
    Ok((headers, content).into_response())
}

fn export(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let format = field(fields, "format").unwrap_or_default();
    let (name, content) = bench.chosen(fields)?.export(&bench.registry, format)?;
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, content).into_response())
}

fn compare(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let chosen: Vec<&str> =
        fields.iter().filter(|(name, _)| name == "run").map(|(_, id)| id.as_str()).collect();
    if !(2..=MAX_COMPARED).contains(&chosen.len()) {
        return Err(Refusal::Unknown("Choose two to six runs in the list, then compare them."));
    }
    let runs = chosen.into_iter().map(|id| bench.folder(id)).collect::<Result<Vec<_>, _>>()?;
    let (maps, comparisons) = compare_runs(&bench.registry, &runs)?;
    let rows: Vec<&CataloguedRun> = runs.iter().map(|folder| &folder.run).collect();
    Ok(Html(compare_page(&rows, &maps, &comparisons, &bench.formats())?).into_response())
}

fn note(bench: &Bench, fields: &Fields) -> Result<Response, Refusal> {
    let id = bench.chosen(fields)?.run.id;
    let text = |name| field(fields, name).unwrap_or_default();
    lock(&bench.history).annotate(id, text("tags"), text("comment"))?;
    Ok(Redirect::to(&format!("/run?run={id}")).into_response())
}

fn index(bench: &Bench, _: &Fields) -> Result<Response, Refusal> {
    *lock(&bench.unreadable) = index_runs(&bench.directory, &mut lock(&bench.history))?;
    Ok(Redirect::to("/").into_response())
}
